// PlanarSystem: the cost F of a planar graph over a subset of its nodes, its linearisation, and its minimum over
// positions.
//
// A pose has the unknowns x, y (m) and yaw (rad), a point x and y. Fixed nodes have no unknowns. Position residuals are
// expressed in the map's axes. The residual of a rotation error d is (cos d - 1, sin d). F is the cost in
// standalone_graph.h. Single-threaded.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <cstddef>
#include <optional>
#include <vector>

#include "actors/pgo/block_matrix.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

using PlanarState = std::vector<Eigen::Vector3d>;  // (x, y, yaw) in the order of StandaloneGraph::nodes.

// Cholesky factorisation in the natural order, because BlockMatrix has already ordered its nodes.
using OrderedCholesky = Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>;

enum class Curvature { kGaussNewton, kExact };

class PlanarSystem {
 public:
  // Inactive nodes, and edges with an inactive end, are ignored. Nodes that are not `free` are constant.
  PlanarSystem(const StandaloneGraph& graph, const std::vector<bool>& active, const std::vector<bool>& free);

  double Cost(const PlanarState& state) const;

  // Sets gradient() to the gradient of F / 2 at `state`, and normal() to the second derivatives of F / 2. With
  // kGaussNewton the second derivatives are approximated by J^T J, which is never indefinite. With kExact they are
  // exact.
  void Linearise(const PlanarState& state, Curvature curvature);
  const BlockMatrix& normal() const { return normal_; }
  const Eigen::VectorXd& gradient() const { return gradient_; }

  PlanarState Plus(const PlanarState& state, const Eigen::VectorXd& step) const;

  // Moves all positions to the minimum of F for the current rotations and, if there are ranges, for the current
  // directions of the ranges. This is one linear solve with a constant matrix.
  //
  // F does not increase (Papalia et al., CORA). Does nothing if the positions are not determined.
  void SettlePositions(PlanarState& state);

 private:
  // A step or a sighting. For a sighting kappa, the weight of the rotation, is zero.
  struct Arm {
    std::size_t from = 0;
    std::size_t to = 0;
    Eigen::Vector2d arm_m = Eigen::Vector2d::Zero();  // Position of `to` in the frame of `from`.
    double turn_rad = 0;
    double tau = 1;
    double kappa = 0;
  };
  struct Range {
    std::size_t from = 0;
    std::size_t to = 0;
    double range_m = 0;
    double weight = 1;  // Inverse variance of the range.
  };

  static std::vector<Arm> ArmsOf(const StandaloneGraph& graph, const std::vector<bool>& active);
  static std::vector<Range> RangesOf(const StandaloneGraph& graph, const std::vector<bool>& active);
  std::vector<BlockMatrix::NodePair> Pairs() const;  // Returns the node pairs of arms, then the node pairs of ranges.
  BlockMatrix MakePositions() const;
  void LineariseArm(std::size_t arm, const PlanarState& state);
  void LineariseRange(std::size_t range, const PlanarState& state);
  void AddGradient(std::size_t node, const Eigen::Vector3d& part);

  std::vector<int> sizes_;  // Number of unknowns of each node.
  std::vector<Arm> arms_;
  std::vector<Range> ranges_;
  BlockMatrix normal_;
  Curvature curvature_ = Curvature::kGaussNewton;
  Eigen::VectorXd gradient_;
  // Normal matrix of the x coordinates; the matrix of the y coordinates is the same. Created at its first use.
  std::optional<BlockMatrix> positions_;
  OrderedCholesky settled_;
};

}  // namespace moondb
