// Where maps and footprints lie on the merged map's grid, and which observation stands above which.
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
#include <optional>
#include <vector>

#include "actors/merge/local_map.h"
#include "actors/merge/quantize.h"
#include "model/error.h"
#include "model/geometry.h"
#include "model/ids.h"

namespace moondb {

// A map and where it is laid.
struct PlacedMap {
  std::shared_ptr<const LocalMap> map;
  Pose map_from_node;
};

// A rover's body at a node.
struct Footprint {
  NodeKey node;
  Pose map_from_node;
};

struct PlacedThing;

// A rectangle of observations: a block of a layer, or a footprint (no `cells`: all of it is free).
struct PlacedBlock {
  PlacedRectangle rectangle;
  const PackedBlock* cells = nullptr;
  const PlacedThing* owner = nullptr;
  std::uint32_t resolution_um = 0;  // 0 for a footprint.
  std::int64_t timestamp_ns = 0;
  std::uint32_t rank = 0;  // Its place in the order of all that are merged, the greatest key first.

  bool is_footprint() const { return cells == nullptr; }
};

// A map or a footprint with its blocks. Does not move while blocks point to it.
struct PlacedThing {
  PlacedMap placed;  // No map: a footprint.
  NodeKey node;      // Of a footprint.
  std::vector<PlacedBlock> blocks;
  CellBox extent;           // Of all its cells, unknown ones too.
  bool is_retired = false;  // Used by Merger.
};

// The greater key first; equal only for two that are the same. Footprints come before all maps.
bool StandsAbove(const PlacedBlock& a, const PlacedBlock& b);

// kInvalid: with field "map_from_node" for a pose that is not finite, or so far out that its page has no number; with
// field "layers" for a map of more than side_cells_max cells of the merged map.
Result<std::unique_ptr<PlacedThing>> PlaceMap(const PlacedMap& placed, const MergeGrid& grid);
Result<std::unique_ptr<PlacedThing>> PlaceFootprint(const Footprint& footprint, const MergeGrid& grid);

// What a block or footprint says of a cell of the grid.
Cell CellUnder(const PlacedBlock& block, std::int64_t x, std::int64_t y);

bool AreSamePose(const Pose& a, const Pose& b);

}  // namespace moondb
