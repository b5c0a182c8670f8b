// Factors: the terms of the pose graph's cost, 1/2 sum |residual|^2 (paper, Section 5.2), with analytic Jacobians.
//
// A node is one parameter block of seven numbers: position x y z (m), quaternion x y z w; map_from_node. PoseManifold
// perturbs it by six: p + dp in the frame `map`, q * exp(dtheta) in the node's own frame.
//
// The Jacobian of a pose block has seven columns: the derivative by (dp, dtheta) in the first six, zeros in the last.
// PoseManifold::PlusJacobian is the matching [I6; 0], so the product that Ceres forms is the derivative by the
// perturbation itself. Hence these factors work with PoseManifold only.
//
// Every Make function returns an object that the caller (a ceres::Problem) owns. Values must be finite and sigmas
// positive: GraphCheck has seen to it.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "model/geometry.h"
#include "model/pose_graph.h"

namespace moondb {

inline constexpr int kPoseSize = 7;
inline constexpr int kPoseTangentSize = 6;

using PoseBlock = std::array<double, kPoseSize>;

PoseBlock ToBlock(const Pose& pose);
Pose FromBlock(const PoseBlock& block);  // Normalises the quaternion.

class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kPoseSize; }
  int TangentSize() const override { return kPoseTangentSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// How a pose may turn: about z only where gravity has levelled it, in the plane without leaving it.
enum class BodyFreedom { kPlanar, kUpright, kSpatial };

// The axes in which it may change, for AxesManifold; a point does not turn.
std::vector<int> AxesOf(BodyFreedom freedom, bool is_point);

// A pose of which some directions only may change: the axes 0 to 5 of PoseManifold's tangent, in rising order. {0, 1,
// 5} is a pose in the plane, {0, 1, 2} a point. Jacobians are read as PoseManifold's.
class AxesManifold final : public ceres::Manifold {
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

// One step of odometry. Blocks: pose i, pose j, scale s. Six residuals:
//   W [ R_i^T (p_j - p_i) - (1 + s) t ;  2 vec(dq) ],   dq = q_measured^-1 q_i^-1 q_j with w >= 0,   W^T W =
//   covariance^-1.
// s is the rover's own odometry scale error: wheels and visual-inertial odometry are wrong by a constant factor.
std::unique_ptr<ceres::CostFunction> MakeOdometryFactor(const Pose& from_from_to, const Matrix6d& covariance);

// One range. Blocks: pose a, pose b, bias. One residual:
//   (|p_a + R_a l_a - p_b - R_b l_b| + bias - range) / sigma
// with the antennas l in the bodies' frames. At zero distance the direction is undefined and counts as zero.
std::unique_ptr<ceres::CostFunction> MakeRangeFactor(double range_m, double sigma_m, const Eigen::Vector3d& antenna_a_m,
                                                     const Eigen::Vector3d& antenna_b_m);

// A point as a pose sees it. Blocks: pose, point (its orientation plays no part). Three residuals:
//   (R^T (l - p) - seen) / sigma
std::unique_ptr<ceres::CostFunction> MakeSightingFactor(const Eigen::Vector3d& from_point_m, double sigma_m);

// Roll and pitch as gravity shows them, yaw free. Block: pose. Two residuals: x and y of
//   (R^T e_z - up) / sigma,   up: the direction of the frame `map`'s z axis, in the body's frame, of unit length.
std::unique_ptr<ceres::CostFunction> MakeGravityFactor(const Eigen::Vector3d& up_in_body, double sigma_rad);

// What is known of a node beforehand. Block: pose. Six residuals: (p - p_0) / sigma_m, and of the turn 2 vec(q q_0^-1),
// in the frame `map`, roll and pitch over sigma_tilt_rad and yaw over sigma_yaw_rad.
struct PosePrior {
  Pose map_from_node;
  double sigma_m = 1;
  double sigma_tilt_rad = 1;
  double sigma_yaw_rad = 1;
};
std::unique_ptr<ceres::CostFunction> MakePosePriorFactor(const PosePrior& prior);

// A scale or a bias that is about zero. Block: the number. One residual: value / sigma.
std::unique_ptr<ceres::CostFunction> MakeZeroPriorFactor(double sigma);

}  // namespace moondb
