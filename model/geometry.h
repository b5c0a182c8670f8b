// Poses, and their conversion from and to messages. A pose named target_from_source transforms coordinates in the frame
// `source` to the frame `target`.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "model/error.h"
#include "proto/pose.pb.h"

namespace moondb {

inline constexpr double kCoordinateMax_m = 1e9;  // Limit of coordinates in messages and files.

struct Pose {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  // A unit quaternion.

  Pose operator*(const Pose& other) const;                        // Composition: a_from_b * b_from_c = a_from_c.
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const;  // Transforms a point: a_from_b * point in b.
  Pose Inverse() const;

  static Pose FromPlanar(double x_m, double y_m, double yaw_rad);
  double Yaw() const;  // Angle of the body's x axis in the horizontal plane, -pi to pi.
};

proto::Pose ToProto(const Pose& pose);

// Converts a pose from a message and normalises its quaternion. Fails with kInvalid for a missing part, a number that
// is not finite, a coordinate beyond 1e9 m, or a quaternion whose length is not within 0.5 to 2.
Result<Pose> FromProto(const proto::Pose& pose);

}  // namespace moondb
