// MapPlacement: everything that a merge needs, already in integers, sorted and bounded. What both backends share.
//
// The policy is a total order (paper, Eq. (1) and its two bullets, Section 5.1). Each known observation of a cell has
// a key: finer resolution, then newer stamp, then larger agent id, then larger record key, then the map's earlier
// layer. The merged cell takes the value of the largest key; unknown has no key; the rover's footprint at each known
// pose is free and stands above everything. A maximum needs no order of arrival: late maps and maps that arrive twice
// lead to the same grid. Nearest sampling only: classes are never interpolated.
//
// Plain values and pure functions, any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "actors/merge/quantize.h"
#include "model/error.h"
#include "model/record_key.h"
#include "model/traversability_map.h"

namespace moondb {

struct MergeGrid {
  std::uint32_t resolution_um = 50'000;  // Of the merged map; 1 mm to 100 m.
  double footprint_length_m = 0.75;      // Along the body's x; at most 512 cells; 0 frees nothing.
  double footprint_width_m = 0.5;
  std::int64_t side_cells_max = 16384;  // Of the merged map.
};

// kInvalid for what lies outside the ranges above, `field` names it.
Result<void> CheckGrid(const MergeGrid& grid);

// Part of a layer: at most kBlockSideCellsMax a side. Neighbours share one column or row, so that the rounding of two
// transforms leaves no seam.
struct LayerBlock {
  std::uint8_t level = 0;
  std::int32_t column = 0;
  std::int32_t row = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  bool operator==(const LayerBlock&) const = default;
};

// A local traversability map as it arrived: immutable, shared by all merges and by the backends' caches.
struct LocalMap {
  RecordKey key;
  std::int64_t stamp_ns = 0;
  TraversabilityMap map;
  std::vector<LayerBlock> blocks;  // Those with at least one known cell.
  std::vector<LayerBlock> bounds;  // All of them.

  AgentId agent() const { return key.stream.origin; }
};

// Splits the layers into blocks. kInvalid if a layer's cells are too fine for the grid (more than kStepCellsMax in one
// of its cells), `field` names it.
Result<std::shared_ptr<const LocalMap>> MakeLocalMap(const RecordKey& key, std::int64_t stamp_ns, TraversabilityMap map,
                                                     const MergeGrid& grid);

struct PlacedBlock {
  PlacedRectangle rectangle;
  LayerBlock block;
  std::uint16_t slot = 0;
};

// One line of the slot table: which map, and where it was laid.
struct PlacedMap {
  std::shared_ptr<const LocalMap> map;
  Pose map_from_node;
};

// Slots are 16 bits; the last stands for no map.
inline constexpr std::uint16_t kNoSlot = 65535;
inline constexpr std::size_t kPlacedMapsMax = kNoSlot;

struct MapPlacement {
  std::uint32_t resolution_um = 0;
  CellBox extent;                   // Of all layers and footprints. Empty without any.
  std::vector<PlacedMap> slots;     // By record key.
  std::vector<PlacedBlock> blocks;  // Largest key first.
  std::vector<PlacedRectangle> footprints;
};

// Maps in any order; one that is there twice (same key) counts once, the first. Errors: kFull for more than
// kPlacedMapsMax maps, or for an extent beyond grid.side_cells_max.
Result<MapPlacement> PlaceMaps(std::vector<PlacedMap> maps, std::span<const Pose> footprints, const MergeGrid& grid);

}  // namespace moondb
