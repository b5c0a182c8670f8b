// Poses and their text in messages. target_from_source transforms a point's coordinates in `source` to `target`.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "model/error.h"
#include "proto/pose.pb.h"

namespace moondb {

inline constexpr double kCoordinateMax_m = 1e9;  // Of what messages and files give.

struct Pose {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  // Unit length.

  Pose operator*(const Pose& other) const;                        // a_from_b * b_from_c = a_from_c.
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const;  // a_from_b * point in b.
  Pose Inverse() const;

  static Pose FromPlanar(double x_m, double y_m, double yaw_rad);
  double Yaw() const;  // Of the body's x axis seen from above, -pi to pi.
};

proto::Pose ToProto(const Pose& pose);

// Normalises the quaternion; kInvalid for a number that is not finite, a quaternion shorter than 0.5 or longer
// than 2, a missing part, or a coordinate beyond 1e9 m.
Result<Pose> FromProto(const proto::Pose& pose);

}  // namespace moondb
