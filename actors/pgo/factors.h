// Factors (cost terms) of the pose graph, with analytic Jacobians. The cost is 1/2 sum |residual|^2 (paper, Section
// 5.2).
//
// A node is one parameter block of seven numbers, map_from_node: position x y z (m), quaternion x y z w. PoseManifold
// perturbs this block by a six-vector: p + dp in the frame `map`, q * exp(dtheta) in the node's own frame.
//
// The Jacobian of a pose block has seven columns: the derivative by (dp, dtheta) in the first six, zeros in the last.
// PoseManifold::PlusJacobian is the matching [I6; 0]. Ceres multiplies the two matrices. The product is the derivative
// by the perturbation. These factors therefore work only with PoseManifold and AxesManifold.
//
// Each Make function returns an object owned by the caller. Requires: values are finite and sigmas positive. CheckGraph
// ensures this.
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "actors/pgo/manifold.h"
#include "model/geometry.h"
#include "model/pose_graph.h"

namespace moondb {

inline constexpr int kPoseSize = 7;
inline constexpr int kPoseTangentSize = 6;

using PoseBlock = std::array<double, kPoseSize>;

PoseBlock ToBlock(const Pose& pose);
Pose FromBlock(const PoseBlock& block);  // Normalises the quaternion.

class PoseManifold final : public Manifold {
 public:
  int AmbientSize() const override { return kPoseSize; }
  int TangentSize() const override { return kPoseTangentSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// How a body may move. kPlanar: within the plane, turning about z. kUpright: anywhere, turning about z only, because
// its roll and pitch are known from gravity. kSpatial: anywhere, turning about any axis.
enum class BodyFreedom { kPlanar, kUpright, kSpatial };

// Returns the tangent axes, for AxesManifold, along which a pose or point may change. A point does not rotate.
std::vector<int> AxesOf(BodyFreedom freedom, bool is_point);

// Manifold of a pose that may change only along some axes. `axes` are indices 0 to 5 of PoseManifold's tangent, in
// ascending order: {0, 1, 5} is a pose in the plane, {0, 1, 2} a point. Factors supply the same Jacobians as for
// PoseManifold.
class AxesManifold final : public Manifold {
 public:
  explicit AxesManifold(std::vector<int> axes) : axes_(std::move(axes)) {}

  int AmbientSize() const override { return kPoseSize; }
  int TangentSize() const override { return static_cast<int>(axes_.size()); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  std::vector<int> axes_;
};

// One odometry step. Blocks: pose i, pose j, scale s. Six residuals:
//
//   W [ R_i^T (p_j - p_i) - (1 + s) t ;  2 vec(dq) ]
//
// R, p and q are the rotation, position and quaternion of a pose. t and q_measured are the position and quaternion of
// from_from_to. W^T W is covariance^-1. dq is q_measured^-1 q_i^-1 q_j with w >= 0. s is the rover's odometry scale
// error, a constant factor.
std::unique_ptr<ceres::CostFunction> MakeOdometryFactor(const Pose& from_from_to, const Matrix6d& covariance);

// One loop closure. Blocks: pose i, pose j. The residuals are those of an odometry step with s = 0.
std::unique_ptr<ceres::CostFunction> MakeLoopClosureFactor(const Pose& from_from_to, const Matrix6d& covariance);

// One range. Blocks: pose a, pose b, bias. One residual:
//   (|p_a + R_a l_a - p_b - R_b l_b| + bias - range) / sigma
// l_a and l_b are the antennas in the body frames. At distance zero the direction is undefined, and the Jacobian is set
// to zero.
std::unique_ptr<ceres::CostFunction> MakeRangeFactor(double range_m, double sigma_m, const Eigen::Vector3d& antenna_a_m,
                                                     const Eigen::Vector3d& antenna_b_m);

// One observation of a point from a pose. Blocks: pose, point (its orientation is ignored). Three residuals:
//   (R^T (l - p) - seen) / sigma
// R and p are the rotation and position of the pose, l is the position of the point, and seen is from_point_m.
std::unique_ptr<ceres::CostFunction> MakeSightingFactor(const Eigen::Vector3d& from_point_m, double sigma_m);

// Roll and pitch as measured by gravity; yaw remains free. Block: pose. Two residuals, the x and y components of
//   (R^T e_z - up) / sigma
// `up` is the z axis of the frame `map`, expressed in the body frame, of unit length.
std::unique_ptr<ceres::CostFunction> MakeGravityFactor(const Eigen::Vector3d& up_in_body, double sigma_rad);

// An absolute measurement of a pose. Block: pose. As many residuals as `prior.extent` says:
//
//   W [ p + R l - p_0 ;  rotation error ]
//
// p_0 and q_0 are the position and quaternion of map_from_node, and l is point_m. W^T W is covariance^-1. The rotation
// error is absent for kPosition, the wrapped difference of the yaws for kPositionYaw, and 2 vec(q q_0^-1), in the frame
// `map`, for kPose.
std::unique_ptr<ceres::CostFunction> MakePriorFactor(const NodePrior& prior);

// Zero-mean prior on a scale or bias. Block: the number. One residual: value / sigma.
std::unique_ptr<ceres::CostFunction> MakeZeroPriorFactor(double sigma);

}  // namespace moondb
