// StandaloneCost: the cost F of a StandaloneGraph, and its minimisation over a subset of the nodes. Spatial graphs use
// Ceres. Planar graphs use planar_descent.h, which needs fewer and shorter steps than Ceres.
//
// F is invariant to rigid motions: if no active node of a connected component is fixed, the component's first pose is
// held constant. `graph` and `options` must outlive this object. Single-threaded, except for Ceres's own threads.
#pragma once

#include <ceres/cost_function.h>

#include <functional>
#include <memory>
#include <vector>

#include "actors/pgo/factors.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

struct PlainOptions {
  int thread_count = 2;
  int iterations_max = 200;
  // Polled once per iteration. If it returns true, the solve ends without convergence.
  std::function<bool()> stop_requested = {};
};

// One flag per node. A solve ignores inactive nodes, and edges with an inactive end.
using ActiveNodes = std::vector<bool>;
// One block per node, in the order of StandaloneGraph::nodes. A point uses only the first three numbers of its block.
using PlainState = std::vector<PoseBlock>;

// The quality of the initial values, which determines the initial trust region. kNear: close to the minimum. kRough:
// farther away. kShallow: in a shallow valley, where an earlier minimisation ended without convergence.
enum class StartQuality { kNear, kRough, kShallow };

struct PlainFit {
  bool has_converged = false;
  // The cost F of the edges between active nodes at the end of the solve; infinity if the result is unusable.
  double cost = 0;
  int iterations = 0;
};

class StandaloneCost {
 public:
  StandaloneCost(const StandaloneGraph& graph, const PlainOptions& options);

  PlainFit Minimise(const ActiveNodes& active, StartQuality quality, PlainState& state) const;

 private:
  struct Term {
    std::unique_ptr<ceres::CostFunction> factor;
    std::size_t from = 0;
    std::size_t to = 0;
    bool has_number = false;  // True if the factor also takes a scale or bias, which is 0 here.
  };

  PlainFit MinimiseInPlane(const ActiveNodes& active, StartQuality quality, PlainState& state) const;
  PlainFit MinimiseInSpace(const ActiveNodes& active, StartQuality quality, PlainState& state) const;
  std::vector<std::size_t> FindStanding(const ActiveNodes& active) const;

  const StandaloneGraph& graph_;
  const PlainOptions& options_;
  std::vector<Term> terms_;  // Empty for planar graphs.
};

}  // namespace moondb
