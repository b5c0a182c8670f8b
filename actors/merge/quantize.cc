#include "actors/merge/quantize.h"

#include <algorithm>
#include <cmath>

#include "model/check.h"

namespace moondb {
namespace {

// Eigen is not used here: it may order the operations of a product differently on another machine.
struct Vector {
  double x = 0;
  double y = 0;
  double z = 0;
};

struct Rotation {
  double x = 0;
  double y = 0;
  double z = 0;
  double w = 1;
};

Rotation RotationOf(const Pose& pose) {
  return {pose.orientation.x(), pose.orientation.y(), pose.orientation.z(), pose.orientation.w()};
}

Vector PositionOf(const Pose& pose) { return {pose.position_m.x(), pose.position_m.y(), pose.position_m.z()}; }

Vector Cross(const Rotation& q, const Vector& v) {
  return {q.y * v.z - q.z * v.y, q.z * v.x - q.x * v.z, q.x * v.y - q.y * v.x};
}

Vector Rotate(const Rotation& q, const Vector& v) {
  const Vector once = Cross(q, v);
  const Vector twice = Cross(q, once);
  return {v.x + 2 * (q.w * once.x + twice.x), v.y + 2 * (q.w * once.y + twice.y), v.z + 2 * (q.w * once.z + twice.z)};
}

Rotation Multiply(const Rotation& a, const Rotation& b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

PlanarPose Project(const Vector& position, const Rotation& q) {
  const double xx = 1 - 2 * (q.y * q.y + q.z * q.z);
  const double yx = 2 * (q.x * q.y + q.w * q.z);
  const double length = std::sqrt(xx * xx + yx * yx);
  if (length < 1e-9) return {position.x, position.y, 1, 0};
  return {position.x, position.y, xx / length, yx / length};
}

std::int64_t ToFixed(double value) { return std::llround(value * static_cast<double>(1 << kFractionBits)); }

// Returns an upper bound on the distance, in grid cells, by which rounding can move an edge of the rectangle. For each
// grid cell between the anchor and the edge, rounding adds an error of at most half a Q10.22 unit to u and to v.
double RoundingCells(double half_x, double half_y, double step) {
  const double unit = 1.0 / static_cast<double>(1 << kFractionBits);
  return 1e-6 + unit * (half_x + half_y + 4) / step;
}

}  // namespace

void CellBox::Add(const CellBox& other) {
  if (other.is_empty()) return;
  if (is_empty()) {
    *this = other;
    return;
  }
  first_x = std::min(first_x, other.first_x);
  first_y = std::min(first_y, other.first_y);
  last_x = std::max(last_x, other.last_x);
  last_y = std::max(last_y, other.last_y);
}

PlanarPose ToPlanar(const Pose& map_from_body) { return Project(PositionOf(map_from_body), RotationOf(map_from_body)); }

PlanarPose ToPlanar(const Pose& map_from_node, const Pose& node_from_map) {
  const Rotation rotation = RotationOf(map_from_node);
  const Vector start = PositionOf(map_from_node);
  const Vector step = Rotate(rotation, PositionOf(node_from_map));
  return Project({start.x + step.x, start.y + step.y, start.z + step.z}, Multiply(rotation, RotationOf(node_from_map)));
}

PlacedRectangle Quantize(const PlanarPose& pose, double center_x_m, double center_y_m, double width_cells,
                         double height_cells, std::uint32_t cell_um, std::uint32_t grid_um) {
  Check(width_cells >= 0 && width_cells <= kBlockSideCellsMax, "a block's width fits Q10.22");
  Check(height_cells >= 0 && height_cells <= kBlockSideCellsMax, "a block's height fits Q10.22");
  const double step = static_cast<double>(grid_um) / cell_um;
  Check(step <= kStepCellsMax, "a grid step fits Q10.22");

  const double x_m = pose.x_m + (pose.cos_yaw * center_x_m - pose.sin_yaw * center_y_m);
  const double y_m = pose.y_m + (pose.sin_yaw * center_x_m + pose.cos_yaw * center_y_m);
  const double x_cells = x_m * 1e6 / grid_um;
  const double y_cells = y_m * 1e6 / grid_um;
  const double anchor_x = std::floor(x_cells);
  const double anchor_y = std::floor(y_cells);

  PlacedRectangle placed;
  placed.anchor_x = static_cast<std::int64_t>(anchor_x);
  placed.anchor_y = static_cast<std::int64_t>(anchor_y);
  placed.step_cos = static_cast<std::int32_t>(ToFixed(step * pose.cos_yaw));
  placed.step_sin = static_cast<std::int32_t>(ToFixed(step * pose.sin_yaw));
  // Offset from the rectangle's centre to the centre of the anchor cell. The offset is small even if the rectangle is
  // far from the origin.
  const double dx = 0.5 - (x_cells - anchor_x);
  const double dy = 0.5 - (y_cells - anchor_y);
  placed.u0 = static_cast<std::int32_t>(ToFixed(width_cells / 2 + step * (pose.cos_yaw * dx + pose.sin_yaw * dy)));
  placed.v0 = static_cast<std::int32_t>(ToFixed(height_cells / 2 + step * (pose.cos_yaw * dy - pose.sin_yaw * dx)));
  placed.width_q = static_cast<std::uint32_t>(ToFixed(width_cells));
  placed.height_q = static_cast<std::uint32_t>(ToFixed(height_cells));

  const double half_x = (std::abs(pose.cos_yaw) * width_cells + std::abs(pose.sin_yaw) * height_cells) / 2 / step;
  const double half_y = (std::abs(pose.sin_yaw) * width_cells + std::abs(pose.cos_yaw) * height_cells) / 2 / step;
  const double slack = RoundingCells(half_x, half_y, step);
  placed.box.first_x = static_cast<std::int64_t>(std::ceil(x_cells - half_x - slack - 0.5));
  placed.box.first_y = static_cast<std::int64_t>(std::ceil(y_cells - half_y - slack - 0.5));
  placed.box.last_x = static_cast<std::int64_t>(std::floor(x_cells + half_x + slack - 0.5));
  placed.box.last_y = static_cast<std::int64_t>(std::floor(y_cells + half_y + slack - 0.5));
  return placed;
}

}  // namespace moondb
