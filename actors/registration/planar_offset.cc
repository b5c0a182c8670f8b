#include "actors/registration/planar_offset.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

namespace moondb {

double WrappedAngle(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

Eigen::Isometry2d PlanarOffset::ToTransform() const {
  return Eigen::Translation2d(x_m, y_m) * Eigen::Rotation2Dd(yaw_rad);
}

PlanarOffset PlanarOffset::From(const Pose& pose) { return {pose.position_m.x(), pose.position_m.y(), pose.Yaw()}; }

PlanarOffset PlanarOffset::Between(const Pose& map_from_first, const Pose& map_from_second) {
  return From(map_from_first).Inverse() * From(map_from_second);
}

PlanarOffset PlanarOffset::operator*(const PlanarOffset& other) const {
  const Eigen::Vector2d moved_m = *this * other.position_m();
  return {moved_m.x(), moved_m.y(), WrappedAngle(yaw_rad + other.yaw_rad)};
}

PlanarOffset PlanarOffset::Inverse() const {
  const Eigen::Vector2d moved_m = Eigen::Rotation2Dd(-yaw_rad) * -position_m();
  return {moved_m.x(), moved_m.y(), WrappedAngle(-yaw_rad)};
}

Eigen::Matrix3d TurnedCovariance(const Eigen::Matrix3d& covariance, double yaw_rad) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(yaw_rad).toRotationMatrix();
  return turn * covariance * turn.transpose();
}

Eigen::Matrix3d ShiftedCovariance(const Eigen::Matrix3d& covariance, const Eigen::Vector2d& arm_m) {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift(0, 2) = -arm_m.y();
  shift(1, 2) = arm_m.x();
  return shift * covariance * shift.transpose();
}

double WorstSigma_m(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance.topLeftCorner<2, 2>().eval());
  return std::sqrt(solver.eigenvalues().maxCoeff());
}

}  // namespace moondb
