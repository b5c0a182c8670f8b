#include "model/geometry.h"

#include <cmath>
#include <string>

#include "proto/pose.pb.h"

namespace moondb {

namespace {

constexpr double kQuaternionLengthMin = 0.5;
constexpr double kQuaternionLengthMax = 2.0;

}  // namespace

Pose Pose::operator*(const Pose& other) const {
  return Pose{position_m + orientation * other.position_m, (orientation * other.orientation).normalized()};
}

Eigen::Vector3d Pose::operator*(const Eigen::Vector3d& point) const { return position_m + orientation * point; }

Pose Pose::Inverse() const {
  const Eigen::Quaterniond inverse = orientation.conjugate();
  return Pose{-(inverse * position_m), inverse};
}

Pose Pose::FromPlanar(double x_m, double y_m, double yaw_rad) {
  const Eigen::Quaterniond turn(std::cos(yaw_rad / 2), 0, 0, std::sin(yaw_rad / 2));
  return Pose{Eigen::Vector3d(x_m, y_m, 0), turn};
}

double Pose::Yaw() const {
  const Eigen::Vector3d forward = orientation * Eigen::Vector3d::UnitX();
  return std::atan2(forward.y(), forward.x());
}

proto::Pose ToProto(const Pose& pose) {
  proto::Pose result;
  result.mutable_position_m()->set_x(pose.position_m.x());
  result.mutable_position_m()->set_y(pose.position_m.y());
  result.mutable_position_m()->set_z(pose.position_m.z());
  result.mutable_orientation()->set_x(pose.orientation.x());
  result.mutable_orientation()->set_y(pose.orientation.y());
  result.mutable_orientation()->set_z(pose.orientation.z());
  result.mutable_orientation()->set_w(pose.orientation.w());
  return result;
}

Result<Pose> FromProto(const proto::Pose& pose) {
  if (!pose.has_position_m()) return Fail(ErrorCode::kInvalid, "is missing", "position_m");
  if (!pose.has_orientation()) return Fail(ErrorCode::kInvalid, "is missing", "orientation");
  const Eigen::Vector3d position(pose.position_m().x(), pose.position_m().y(), pose.position_m().z());
  if (!position.allFinite()) return Fail(ErrorCode::kInvalid, "is not finite", "position_m");
  if (position.cwiseAbs().maxCoeff() > kCoordinateMax_m) {
    return Fail(ErrorCode::kInvalid, "lies beyond 1e9 m", "position_m");
  }
  const proto::Quaternion& q = pose.orientation();
  const Eigen::Quaterniond orientation(q.w(), q.x(), q.y(), q.z());
  const double length = orientation.norm();
  if (!std::isfinite(length)) return Fail(ErrorCode::kInvalid, "is not finite", "orientation");
  if (length < kQuaternionLengthMin || length > kQuaternionLengthMax) {
    return Fail(ErrorCode::kInvalid, "is a quaternion of length " + std::to_string(length) + ", not 1", "orientation");
  }
  return Pose{position, orientation.normalized()};
}

}  // namespace moondb
