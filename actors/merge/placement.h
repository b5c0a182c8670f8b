// Placement of maps and footprints on the merged map's grid, and the priority of observations.
//
// Each known observation of a cell has a priority key (paper, Section 5.1, Eq. (1)): finer resolution, then newer
// timestamp, then larger agent id, then larger record key, then the map's earlier layer. The merged cell takes the
// value of the observation with the greatest key, whatever the order of arrival. The rover's footprint at a node is
// free and overrides all maps. A merged cell samples the nearest cell of a layer; values are never interpolated.
//
// Value types and pure functions, usable on any thread.
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
#include "model/origin_quota.h"

namespace moondb {

// A map and its pose.
struct PlacedMap {
  std::shared_ptr<const LocalMap> map;
  Pose map_from_node;
};

// A rover's body at a node.
struct Footprint {
  NodeKey node;
  Pose map_from_node;
  RecordKey record = {};  // Record of the node's raw pose; all zeros if there is none. Only its age is used.
};

struct PlacedThing;

// A rectangle of observations: a block of a layer, or a footprint. All cells of a footprint are free; its `cells` is
// null.
struct PlacedBlock {
  PlacedRectangle rectangle;
  const PackedBlock* cells = nullptr;
  const PlacedThing* owner = nullptr;
  std::uint32_t resolution_um = 0;  // Cell size of the layer; 0 for a footprint.
  std::int64_t timestamp_ns = 0;
  std::uint32_t rank = 0;  // Position of the block in the list of all merged blocks, sorted by descending key.

  bool is_footprint() const { return cells == nullptr; }
};

// A map or footprint and its blocks. Must not move in memory, because each block points to its owner.
struct PlacedThing {
  PlacedMap placed;  // placed.map is null if this is a footprint.
  NodeKey node;      // Node of the footprint; not set for a map.
  RecordAge age;     // Age of the map's record, or of Footprint::record.
  std::vector<PlacedBlock> blocks;
  CellBox extent;           // Bounding box of all cells, including unknown cells.
  bool is_retired = false;  // Set by Merger when the map or footprint is withdrawn.
};

// Returns true if the key of `a` is greater. This is a strict total order. Footprints have greater keys than all maps.
bool StandsAbove(const PlacedBlock& a, const PlacedBlock& b);

// Places a map or a footprint on the grid. Returns kInvalid with field "map_from_node" if the pose is not finite, or
// too far from the origin for the range of page numbers. Returns kInvalid with field "layers" if a side of the map
// exceeds side_cells_max cells of the merged map.
Result<std::unique_ptr<PlacedThing>> PlaceMap(const PlacedMap& placed, const MergeGrid& grid);
Result<std::unique_ptr<PlacedThing>> PlaceFootprint(const Footprint& footprint, const MergeGrid& grid);

// Returns the value of the block or footprint at a cell of the grid; kUnknown outside of the block or footprint.
Cell CellUnder(const PlacedBlock& block, std::int64_t x, std::int64_t y);

bool AreSamePose(const Pose& a, const Pose& b);

}  // namespace moondb
