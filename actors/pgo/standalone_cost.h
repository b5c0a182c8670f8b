// StandaloneCost: the cost F of a StandaloneGraph, and its minimisation over a part of the nodes: in space by Ceres, in
// the plane by planar_descent.h, which takes fewer and shorter steps.
//
// Factors are made once and serve every start and every prefix of time. Where no active node of a connected part is
// fixed, its first pose stands still: F does not change when all move together. Single-threaded apart from Ceres' own
// threads. `graph` must outlive it.
#pragma once

#include <ceres/cost_function.h>

#include <functional>
#include <memory>
#include <vector>

#include "actors/pgo/factors.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

struct PlainOptions {
  int thread_count = 2;  // Of Ceres.
  int iterations_max = 200;
  // Polled once per iteration; true ends the solve, which then has not converged.
  std::function<bool()> stop_requested = {};
};

// One for each node; an inactive node has no part in a solve, nor has an edge with an inactive end.
using ActiveNodes = std::vector<bool>;
using PlainState = std::vector<PoseBlock>;  // Of StandaloneGraph::nodes; points use the first three numbers.

// How near the minimum a solve begins: decides how boldly it steps. kShallow: in a valley that others did not get
// through.
enum class StartQuality { kNear, kRough, kShallow };

struct PlainFit {
  bool has_converged = false;
  double cost = 0;  // F over the active nodes' edges, where the solve ended; infinity where that is no solution.
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
    bool has_number = false;  // Also takes the scale or the bias, which are 0 here.
  };

  PlainFit MinimiseInPlane(const ActiveNodes& active, StartQuality quality, PlainState& state) const;
  PlainFit MinimiseInSpace(const ActiveNodes& active, StartQuality quality, PlainState& state) const;
  std::vector<std::size_t> FindStanding(const ActiveNodes& active) const;

  const StandaloneGraph& graph_;
  const PlainOptions& options_;
  std::vector<Term> terms_;  // None in the plane.
};

}  // namespace moondb
