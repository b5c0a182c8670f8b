#include "model/line_fields.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/text.h"

namespace moondb {

namespace {

constexpr int kPlanarRows[3] = {0, 1, 5};
constexpr double kQuaternionTolerance = 0.01;
// A quaternion whose length differs from 1 by at most this is not normalised again, so that a normalised quaternion
// reads back bit for bit.
constexpr double kQuaternionUnitSlack = 1e-12;

// Returns the error for a text that is no finite number. Programs with a locale that has decimal commas write "0,5".
std::string NumberError(std::string_view text) {
  std::string with_point(text);
  std::replace(with_point.begin(), with_point.end(), ',', '.');
  const std::string quoted = "'" + std::string(text) + "'";
  if (ParseDouble(with_point)) return quoted + " has a decimal comma: write " + with_point;
  return quoted + " is not a finite number";
}

}  // namespace

LineFields::LineFields(std::string_view line) : fields_(Split(line, ' ')) {}

void LineFields::Stop(std::string error) {
  if (error_.empty()) error_ = std::move(error);
}

std::string_view LineFields::Take() {
  if (left() == 0) {
    Stop("the line ends too early");
    return {};
  }
  return fields_[next_++];
}

double LineFields::Number() {
  const std::string_view text = Take();
  const std::optional<double> value = ParseDouble(text);
  if (!value) Stop(NumberError(text));
  return value.value_or(0);
}

std::uint64_t LineFields::Index() {
  const std::string_view text = Take();
  const std::optional<std::uint64_t> value = ParseUnsigned(text);
  if (!value) Stop("'" + std::string(text) + "' is not the number of a vertex");
  return value.value_or(0);
}

std::int64_t LineFields::Timestamp() {
  const std::string_view text = Take();
  const std::optional<std::int64_t> timestamp_ns = ParseTimestampNs(text);
  if (!timestamp_ns) Stop("'" + std::string(text) + "' is not a timestamp in seconds");
  return timestamp_ns.value_or(0);
}

Eigen::Vector3d LineFields::Position(bool is_planar) {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (int i = 0; i < (is_planar ? 2 : 3); ++i) position[i] = Number();
  if (position.cwiseAbs().maxCoeff() > kCoordinateMax_m) Stop("the position lies beyond 1e9 m");
  return position;
}

Pose LineFields::PoseOf(bool is_planar) {
  const Eigen::Vector3d position = Position(is_planar);
  if (is_planar) return Pose::FromPlanar(position.x(), position.y(), Number());
  return Pose{position, Orientation()};
}

Eigen::Quaterniond LineFields::Orientation() {
  const double x = Number();
  const double y = Number();
  const double z = Number();
  const double w = Number();
  const Eigen::Quaterniond read(w, x, y, z);
  const double length = read.norm();
  if (std::abs(length - 1) > kQuaternionTolerance) {
    Stop("the quaternion has the length " + FormatDouble(length) + ", not 1");
    return Eigen::Quaterniond::Identity();
  }
  return std::abs(length - 1) <= kQuaternionUnitSlack ? read : read.normalized();
}

Result<void> ParseLines(TextLines lines, const std::string& name,
                        const std::function<void(LineFields& fields, std::size_t line)>& parse) {
  while (const std::optional<std::string_view> line = lines.Next()) {
    const auto stop = [&](std::string why) {
      return Fail(ErrorCode::kInvalid, std::move(why), FileLine(name, lines.number()));
    };
    if (line->size() > kGraphLineBytesMax) return stop("the line is longer than 4096 bytes");
    LineFields fields(*line);
    if (fields.left() == 0 || line->front() == '#') continue;
    parse(fields, lines.number());
    if (fields.error().empty() && fields.left() > 0) fields.Stop("the line has too many fields");
    if (!fields.error().empty()) return stop(fields.error());
  }
  return lines.result();
}

void SetPlanar(const Eigen::Matrix3d& planar, Matrix6d& spatial) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) spatial(kPlanarRows[row], kPlanarRows[column]) = planar(row, column);
  }
}

Eigen::Matrix3d PlanarOf(const Matrix6d& spatial) {
  Eigen::Matrix3d planar;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) planar(row, column) = spatial(kPlanarRows[row], kPlanarRows[column]);
  }
  return planar;
}

double ExactPlanarYaw(const Eigen::Quaterniond& q) {
  constexpr int kSteps = 8;
  // Some files contain a yaw beyond pi. The signs of z and w preserve it: the computed yaw lies between -2 pi and 2 pi.
  const double yaw_rad = 2 * std::atan2(q.z(), q.w());
  double above = yaw_rad;
  double below = yaw_rad;
  for (int step = 0; step < kSteps; ++step) {
    for (const double candidate : {above, below}) {
      if (Pose::FromPlanar(0, 0, candidate).orientation.coeffs() == q.coeffs()) return candidate;
    }
    above = std::nextafter(above, 10.0);
    below = std::nextafter(below, -10.0);
  }
  return yaw_rad;
}

}  // namespace moondb
