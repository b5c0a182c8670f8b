// PlanarSystem: the cost F of a planar graph over a part of its nodes, its linearisation, and its minimum over
// positions.
//
// A pose has the unknowns x, y (m) and yaw (rad), a point x and y; nodes that stand have none. Residuals are taken
// along the map's axes, a turn's as (cos d - 1, sin d) of its error d: F is that of standalone_graph.h.
// Single-threaded.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <cstddef>
#include <optional>
#include <vector>

#include "actors/pgo/block_matrix.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

using PlanarState = std::vector<Eigen::Vector3d>;  // Of StandaloneGraph::nodes: x, y, yaw.

// In the natural order: BlockMatrix has ordered its nodes.
using OrderedCholesky = Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>;

enum class Curvature { kGaussNewton, kExact };

class PlanarSystem {
 public:
  // Nodes that are not `active` have no part, nor has an edge with such an end; nodes that are not `free` stand.
  PlanarSystem(const StandaloneGraph& graph, const std::vector<bool>& active, const std::vector<bool>& free);

  double Cost(const PlanarState& state) const;

  // Makes gradient() that of F / 2 at `state`, and normal() its second derivatives: J^T J for kGaussNewton, which is
  // never indefinite, and the true ones for kExact.
  void Linearise(const PlanarState& state, Curvature curvature);
  const BlockMatrix& normal() const { return normal_; }
  const Eigen::VectorXd& gradient() const { return gradient_; }

  PlanarState Plus(const PlanarState& state, const Eigen::VectorXd& step) const;

  // Moves all positions to where F is lowest for these turns and, where ranges are, for these directions between their
  // ends: one linear solve with a matrix that never changes. F does not rise, since (|p| - r)^2 is the least of
  // |p - r n|^2 over unit vectors n (Papalia et al., CORA). Nothing moves where the positions are not determined.
  void SettlePositions(PlanarState& state);

 private:
  // A step, or a sighting, whose turn has no weight.
  struct Arm {
    std::size_t from = 0;
    std::size_t to = 0;
    Eigen::Vector2d arm_m = Eigen::Vector2d::Zero();  // In the first node's frame.
    double turn_rad = 0;
    double tau = 1;
    double kappa = 0;
  };
  struct Range {
    std::size_t from = 0;
    std::size_t to = 0;
    double range_m = 0;
    double weight = 1;  // 1 / variance.
  };

  static std::vector<Arm> ArmsOf(const StandaloneGraph& graph, const std::vector<bool>& active);
  static std::vector<Range> RangesOf(const StandaloneGraph& graph, const std::vector<bool>& active);
  std::vector<BlockMatrix::NodePair> Pairs() const;  // Arms, then ranges.
  BlockMatrix MakePositions() const;
  void LineariseArm(std::size_t arm, const PlanarState& state);
  void LineariseRange(std::size_t range, const PlanarState& state);
  void AddGradient(std::size_t node, const Eigen::Vector3d& part);

  std::vector<int> sizes_;  // Unknowns, by node.
  std::vector<Arm> arms_;
  std::vector<Range> ranges_;
  BlockMatrix normal_;
  Curvature curvature_ = Curvature::kGaussNewton;
  Eigen::VectorXd gradient_;
  std::optional<BlockMatrix> positions_;  // Of x, and of y as well; made at the first use.
  OrderedCholesky settled_;
};

}  // namespace moondb
