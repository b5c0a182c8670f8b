// Integer placement of a rotated rectangle of cells on the merged map's grid (paper, Section 5.1).
//
// A grid cell (X, Y) is sampled at its centre. The coordinates of this centre in a rectangle of n x m cells are
//
//   u(X, Y) = u0 + (X - anchor_x) * step_cos + (Y - anchor_y) * step_sin
//   v(X, Y) = v0 - (X - anchor_x) * step_sin + (Y - anchor_y) * step_cos
//
// in units of the rectangle's cells, Q10.22, from its lower left corner. The cell is inside if u is in the half-open
// interval [0, width_q) and v in [0, height_q). The rectangle's column is then u >> 22 and its row v >> 22.
//
// Doubles are rounded once, relative to the grid cell under the rectangle's centre. All later steps add the same
// integers, so all backends and agents get the same bytes, even 1,000 km from the origin. Libm and fused multiply-add
// differ between machines. Rotations therefore use the stored quaternion without trigonometry, and the .cc file is
// compiled with -ffp-contract=off.
//
// Thread-safe.
#pragma once

#include <cstdint>

#include "model/geometry.h"

namespace moondb {

inline constexpr int kFractionBits = 22;

// Maximum side of a block, in cells. Coordinates in Q10.22 distinguish 1024 cells; the other 512 are for grid cells
// outside the block.
inline constexpr std::int32_t kBlockSideCellsMax = 512;

// Maximum ratio of the grid's cell size to the rectangle's cell size; larger ratios would overflow Q10.22.
inline constexpr std::uint32_t kStepCellsMax = 256;

// Box of cells from the first to the last, both included. Empty if last < first.
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
  CellBox box;  // Contains all grid cells inside the rectangle.
  bool operator==(const PlacedRectangle&) const = default;
};

// A pose projected to the horizontal plane. Its heading is that of the body's x axis, or 0 if the x axis is vertical.
struct PlanarPose {
  double x_m = 0;
  double y_m = 0;
  double cos_yaw = 1;
  double sin_yaw = 0;
};

PlanarPose ToPlanar(const Pose& map_from_body);

// Composes the two poses in 3D and projects the result to the horizontal plane.
PlanarPose ToPlanar(const Pose& map_from_node, const Pose& node_from_map);

// Places a rectangle of width x height cells of size cell_um on a grid of cell size grid_um. The rectangle's centre is
// (center_x_m, center_y_m) in the frame `pose`. Requires (Check() aborts otherwise): at most kBlockSideCellsMax cells
// per side, and grid_um at most kStepCellsMax * cell_um.
PlacedRectangle Quantize(const PlanarPose& pose, double center_x_m, double center_y_m, double width_cells,
                         double height_cells, std::uint32_t cell_um, std::uint32_t grid_um);

}  // namespace moondb
