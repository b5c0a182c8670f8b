#include "actors/merge/placement.h"

#include <cmath>
#include <limits>
#include <string>
#include <tuple>

#include "actors/merge/tile.h"

namespace moondb {
namespace {

// Maximum distance of a pose from the origin, in cells. Within this distance, casts to int64 cannot overflow. HasPages
// checks a stricter limit.
constexpr double kFarthestCells = 1e15;

bool IsFinite(const Pose& pose) { return pose.position_m.allFinite() && pose.orientation.coeffs().allFinite(); }

bool HasPage(std::int64_t cell) {
  const std::int64_t page = cell >> kPageSideBits;
  return page >= std::numeric_limits<std::int32_t>::min() && page <= std::numeric_limits<std::int32_t>::max();
}

bool HasPages(const CellBox& box) {
  return box.is_empty() || (HasPage(box.first_x) && HasPage(box.first_y) && HasPage(box.last_x) && HasPage(box.last_y));
}

bool IsNear(const PlanarPose& pose, const MergeGrid& grid) {
  const double bound_m = kFarthestCells * 1e-6 * grid.resolution_um;
  return std::abs(pose.x_m) < bound_m && std::abs(pose.y_m) < bound_m;
}

auto TooFar() {
  return Fail(ErrorCode::kInvalid, "is not finite or lies outside the range of page numbers", "map_from_node");
}

PlacedRectangle PlaceBlock(const PlanarPose& pose, const LocalLayer& layer, const LayerBlock& block,
                           std::uint32_t grid_um) {
  const double cell_m = static_cast<double>(layer.resolution_um) / 1e6;
  const double x_cells = block.column + (block.width - layer.width) / 2.0;
  const double y_cells = block.row + (block.height - layer.height) / 2.0;
  return Quantize(pose, layer.center_x_m + x_cells * cell_m, layer.center_y_m + y_cells * cell_m, block.width,
                  block.height, layer.resolution_um, grid_um);
}

}  // namespace

bool StandsAbove(const PlacedBlock& a, const PlacedBlock& b) {
  if (a.resolution_um != b.resolution_um) return a.resolution_um < b.resolution_um;
  if (a.is_footprint()) return a.owner->node < b.owner->node;
  if (a.timestamp_ns != b.timestamp_ns) return a.timestamp_ns > b.timestamp_ns;
  // A record key starts with its agent, so this also orders by agent id.
  const RecordKey& key_a = a.owner->placed.map->key;
  const RecordKey& key_b = b.owner->placed.map->key;
  if (key_a != key_b) return key_a > key_b;
  const LayerBlock& block_a = a.cells->block();
  const LayerBlock& block_b = b.cells->block();
  return std::tuple(block_a.level, block_a.row, block_a.column) <
         std::tuple(block_b.level, block_b.row, block_b.column);
}

Result<std::unique_ptr<PlacedThing>> PlaceMap(const PlacedMap& placed, const MergeGrid& grid) {
  if (!IsFinite(placed.map_from_node)) return TooFar();
  auto thing = std::make_unique<PlacedThing>();
  thing->placed = placed;
  thing->age = AgeOf(placed.map->key);
  const LocalMap& map = *placed.map;
  const PlanarPose pose = ToPlanar(placed.map_from_node, map.node_from_map);
  if (!IsNear(pose, grid)) return TooFar();
  for (const LayerBlock& block : map.bounds) {
    thing->extent.Add(PlaceBlock(pose, map.layers[block.level], block, grid.resolution_um).box);
  }
  if (!HasPages(thing->extent)) return TooFar();
  if (thing->extent.width() > grid.side_cells_max || thing->extent.height() > grid.side_cells_max) {
    return Fail(ErrorCode::kInvalid,
                "cover " + std::to_string(thing->extent.width()) + " x " + std::to_string(thing->extent.height()) +
                    " cells of the merged map, of which at most " + std::to_string(grid.side_cells_max) +
                    " a side can be read",
                "layers");
  }
  thing->blocks.reserve(map.blocks.size());
  for (const PackedBlock& cells : map.blocks) {
    const LocalLayer& layer = map.layers[cells.block().level];
    const PlacedRectangle rectangle = PlaceBlock(pose, layer, cells.block(), grid.resolution_um);
    if (rectangle.box.is_empty()) continue;
    thing->blocks.push_back({rectangle, &cells, thing.get(), layer.resolution_um, map.timestamp_ns});
  }
  return thing;
}

Result<std::unique_ptr<PlacedThing>> PlaceFootprint(const Footprint& footprint, const MergeGrid& grid) {
  if (!IsFinite(footprint.map_from_node)) return TooFar();
  auto thing = std::make_unique<PlacedThing>();
  thing->placed.map_from_node = footprint.map_from_node;
  thing->node = footprint.node;
  const PlanarPose pose = ToPlanar(footprint.map_from_node);
  if (!IsNear(pose, grid)) return TooFar();
  const double length_cells = grid.footprint_length_m * 1e6 / grid.resolution_um;
  const double width_cells = grid.footprint_width_m * 1e6 / grid.resolution_um;
  const PlacedRectangle rectangle =
      Quantize(pose, 0, 0, length_cells, width_cells, grid.resolution_um, grid.resolution_um);
  const bool is_nothing = rectangle.width_q == 0 || rectangle.height_q == 0;
  if (is_nothing || rectangle.box.is_empty()) return thing;
  if (!HasPages(rectangle.box)) return TooFar();
  thing->extent = rectangle.box;
  thing->blocks.push_back({rectangle, nullptr, thing.get()});
  return thing;
}

Cell CellUnder(const PlacedBlock& block, std::int64_t x, std::int64_t y) {
  const PlacedRectangle& placed = block.rectangle;
  if (!placed.box.Touches({x, y, x, y})) return Cell::kUnknown;
  const std::int64_t i = x - placed.anchor_x;
  const std::int64_t j = y - placed.anchor_y;
  const std::int64_t u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
  const std::int64_t v = placed.v0 - i * placed.step_sin + j * placed.step_cos;
  if (u < 0 || u >= std::int64_t{placed.width_q} || v < 0 || v >= std::int64_t{placed.height_q}) {
    return Cell::kUnknown;
  }
  if (block.is_footprint()) return Cell::kFree;
  return block.cells->At(static_cast<std::int32_t>(u >> kFractionBits), static_cast<std::int32_t>(v >> kFractionBits));
}

bool AreSamePose(const Pose& a, const Pose& b) {
  return a.position_m == b.position_m && a.orientation.coeffs() == b.orientation.coeffs();
}

}  // namespace moondb
