// Integer placement: where a rotated rectangle of cells lies on the merged map's grid (paper, Section 5.1).
//
// A grid cell (X, Y) is asked by its centre. For a rectangle of n x m cells of its own, its coordinates there are
//
//   u(X, Y) = u0 + (X - anchor_x) * step_cos + (Y - anchor_y) * step_sin
//   v(X, Y) = v0 - (X - anchor_x) * step_sin + (Y - anchor_y) * step_cos
//
// in Q10.22 of the rectangle's cells, from its lower left corner. The cell counts if u lies in the half-open
// [0, width_q) and v in [0, height_q); then the rectangle's column is u >> 22 and its row v >> 22. The doubles end
// here: they are rounded once, anchored at the grid cell under the rectangle's centre, and whatever merges afterwards
// adds the same integers, so that every backend and every agent gets the same bytes, 1,000 km from the origin too.
// Rotations come from the stored quaternion without trigonometry, and the .cc is compiled with -ffp-contract=off:
// libm and fused multiply-add differ between machines.
//
// Pure functions, any thread.
#pragma once

#include <cstdint>

#include "model/geometry.h"

namespace moondb {

inline constexpr int kFractionBits = 22;

// A larger block would leave Q10.22. Modulo 1024 cells it leaves 512 spare for what is asked beside the rectangle.
inline constexpr std::int32_t kBlockSideCellsMax = 512;

// Of the grid's cell over the rectangle's: for the same reason.
inline constexpr std::uint32_t kStepCellsMax = 256;

// Cells first to last, both included; empty where last < first.
struct CellBox {
  std::int64_t first_x = 0;
  std::int64_t first_y = 0;
  std::int64_t last_x = -1;
  std::int64_t last_y = -1;

  bool is_empty() const { return last_x < first_x || last_y < first_y; }
  std::int64_t width() const { return is_empty() ? 0 : last_x - first_x + 1; }
  std::int64_t height() const { return is_empty() ? 0 : last_y - first_y + 1; }
  bool Touches(const CellBox& other) const {
    return !is_empty() && !other.is_empty() && first_x <= other.last_x && other.first_x <= last_x &&
           first_y <= other.last_y && other.first_y <= last_y;
  }
  void Add(const CellBox& other);
  bool operator==(const CellBox&) const = default;
};

struct PlacedRectangle {
  std::int64_t anchor_x = 0;
  std::int64_t anchor_y = 0;
  std::int32_t u0 = 0;
  std::int32_t v0 = 0;
  std::int32_t step_cos = 0;
  std::int32_t step_sin = 0;
  std::uint32_t width_q = 0;
  std::uint32_t height_q = 0;
  CellBox box;  // No cell outside it counts.
  bool operator==(const PlacedRectangle&) const = default;
};

// A pose seen from above. The heading is that of the body's x axis; one that points straight up or down has heading 0.
struct PlanarPose {
  double x_m = 0;
  double y_m = 0;
  double cos_yaw = 1;
  double sin_yaw = 0;
};

PlanarPose ToPlanar(const Pose& map_from_body);

// Of map_from_node * node_from_map, composed in space and then seen from above.
PlanarPose ToPlanar(const Pose& map_from_node, const Pose& node_from_map);

// A rectangle of width x height cells of cell_um, whose centre is (center_x_m, center_y_m) in the frame at `pose`, on
// a grid of grid_um. At most kBlockSideCellsMax cells a side, and grid_um at most kStepCellsMax * cell_um (Check).
PlacedRectangle Quantize(const PlanarPose& pose, double center_x_m, double center_y_m, double width_cells,
                         double height_cells, std::uint32_t cell_um, std::uint32_t grid_um);

}  // namespace moondb
