// PlanarOffset: a pose in the plane. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "model/geometry.h"

namespace moondb {

// Returns the angle from -pi to pi.
double WrappedAngle(double angle_rad);

// A pose in the plane.
struct PlanarOffset {
  double x_m = 0;
  double y_m = 0;
  double yaw_rad = 0;

  Eigen::Vector2d operator*(const Eigen::Vector2d& point_m) const { return ToTransform() * point_m; }
  // Projects a pose to the horizontal plane.
  static PlanarOffset From(const Pose& pose);
  // Returns first_from_second of two poses in the frame `map`, both projected to the horizontal plane.
  static PlanarOffset Between(const Pose& map_from_first, const Pose& map_from_second);
  Eigen::Isometry2d ToTransform() const;
  Pose ToPose() const { return Pose::FromPlanar(x_m, y_m, yaw_rad); }
  // Composition and inverse, as those of poses.
  PlanarOffset operator*(const PlanarOffset& other) const;
  PlanarOffset Inverse() const;
  Eigen::Vector2d position_m() const { return {x_m, y_m}; }
};

// Return a covariance of x and y (m) and yaw (rad) along axes that are turned by `-yaw_rad`, and at a point of the same
// body that lies `arm_m` away.
Eigen::Matrix3d TurnedCovariance(const Eigen::Matrix3d& covariance, double yaw_rad);
Eigen::Matrix3d ShiftedCovariance(const Eigen::Matrix3d& covariance, const Eigen::Vector2d& arm_m);

// Returns the standard deviation of the position along its worst direction (m).
double WorstSigma_m(const Eigen::Matrix3d& covariance);

}  // namespace moondb
