// Merger: maintains a merged occupancy grid with the values unknown, free and hazard (paper, Section 5), and the source
// (map or footprint) of each cell's value.
//
// Maps and footprints may be put, moved and withdrawn in any order. Merge() then updates the affected tiles. The values
// and sources depend only on the current maps and footprints, byte for byte: not on their order, on earlier merges, or
// on the backend. The map is unbounded; only pages that once had a known cell take memory. Assign() divides the pages
// fairly among the origins and leaves out the items that have no room (page_shares.h). Several mergers may share
// LocalMaps.
//
//   Merger merger(grid, *CreateGatherBackend(MergeBackend::kAuto));
//   merger.Put({local_map, map_from_node});
//   merger.PutFootprint({node, map_from_node});
//   merger.Merge({});
//   const MergedMap map = *merger.ReadCells(merger.extent());
//
// Used by one thread at a time. Reads return the state of the last successful Merge(). After a failed Merge() some
// tiles may be newer than others.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "actors/merge/crop.h"
#include "actors/merge/gather_backend.h"
#include "actors/merge/placement.h"
#include "actors/merge/tile.h"
#include "model/error.h"
#include "model/grid.h"

namespace moondb {

// Level of a cell whose value comes from a footprint. Other levels are layer numbers in the winning map; layer 0 is the
// finest.
inline constexpr std::uint8_t kFootprintLevel = 255;

// Slot of a cell whose value does not come from a map.
inline constexpr std::uint32_t kNoSlot = UINT32_MAX;

// A region of the merged map with its provenance.
struct MergeResult {
  MergedMap merged;
  // Slot and level of each cell, in the order of merged.grid.cells. A slot is an index in `maps`. An unknown cell has
  // kNoSlot and level 0. A cell won by a footprint has kNoSlot and kFootprintLevel.
  std::vector<std::uint32_t> slots;
  std::vector<std::uint8_t> levels;
  // Maps that win a cell in this region, with the poses that were used, sorted by record key.
  std::vector<PlacedMap> maps;

  bool operator==(const MergeResult& other) const;  // Compares maps by their keys.
};

// The value that one map or footprint has for a cell.
struct Observation {
  PlacedMap placed;  // placed.map is null if the observation is a footprint.
  NodeKey node;      // Node of the map or footprint.
  std::uint8_t level = kFootprintLevel;
  std::uint32_t resolution_um = 0;
  Cell cell = Cell::kUnknown;
};

// A map and the number of cells whose value comes from the map.
struct MapWins {
  PlacedMap placed;
  std::uint64_t cells = 0;
  CellBox extent;  // Bounding box of all cells of the map, including unknown cells.
};

struct TileKey {
  PageKey page;
  std::uint8_t tile = 0;  // Index in the page, row by row, 4 tiles per row.
  auto operator<=>(const TileKey&) const = default;
};

struct MergeSummary {
  std::uint64_t version = 0;
  std::size_t gathered_tiles = 0;
  std::size_t changed_tiles = 0;  // Number of gathered tiles in which a value changed.
  bool is_full = false;           // True if all tiles were gathered, because most of the input had changed.
};

class Merger {
 public:
  // Requires: `grid` passes CheckGrid. Several mergers may share the backend.
  Merger(const MergeGrid& grid, std::shared_ptr<GatherBackend> backend);
  ~Merger();

  // Adds a map, or moves the map with the same key. A key must always identify the same map. Errors are those of
  // PlaceMap; after an error nothing has changed.
  Result<void> Put(const PlacedMap& placed);

  // Removes a map. Returns false if no map has this key.
  bool Withdraw(const RecordKey& key);

  // Adds a footprint, which marks the cells under a rover's body as free, or moves the footprint of the same node.
  // Errors are those of PlaceFootprint.
  Result<void> PutFootprint(const Footprint& footprint);
  bool WithdrawFootprint(const NodeKey& node);

  // Replaces all maps and footprints. If several maps have the same key, or several footprints the same node, the first
  // is used. Returns one error for each map or footprint that cannot be placed and is left out. Items beyond their
  // origin's share of grid.pages_max pages are left out too; CountWithoutRoom() counts them. The next Merge() never
  // returns kFull, unless Put or PutFootprint adds more.
  std::vector<Error> Assign(std::span<const PlacedMap> maps, std::span<const Footprint> footprints);

  // Updates the affected tiles. After an error some tiles are still old; the next Merge() updates them. Errors are
  // those of GatherBackend::Gather, and kFull if the maps and footprints take more than grid.pages_max pages.
  Result<MergeSummary> Merge(const StopPredicate& stop);

  // Bounding box of all cells of all maps, including unknown cells, and of all footprints.
  const CellBox& extent() const { return extent_; }
  // Number of times that pages were dropped to stay within grid.pages_max. ChangedSince does not report the earlier
  // changes in dropped pages.
  std::uint64_t forgotten() const { return forgotten_; }
  // Counts the merges that gathered at least one tile.
  std::uint64_t version() const { return version_; }
  std::size_t map_count() const { return maps_.size(); }
  std::size_t footprint_count() const { return footprints_.size(); }
  // Number of maps and footprints that the last Assign left out because their origin had no room for more, by origin.
  const std::map<AgentId, std::uint64_t>& CountWithoutRoom() const { return without_room_; }
  // Returns the part of the map that one export can hold (crop.h).
  Crop CropTo(std::int64_t area_cells_max) const;
  const MergeGrid& grid() const { return grid_; }
  const GatherBackend& backend() const { return *backend_; }

  // Return the cells of any box, including unknown areas. Read also returns the source of each cell. Both return kFull
  // if a side exceeds grid.side_cells_max.
  Result<MergedMap> ReadCells(const CellBox& box) const;
  Result<MergeResult> Read(const CellBox& box) const;

  // Returns the tiles in which merges after `version` changed a value, sorted. ReadCells(BoxOf(key.page, key.tile))
  // reads the cells of such a tile.
  std::vector<TileKey> ChangedSince(std::uint64_t version) const;

  // Returns the observations of all maps and footprints that know the cell, the winning observation first.
  std::vector<Observation> Observe(std::int64_t x, std::int64_t y) const;

  // Returns each map with the number of cells that it wins, sorted by record key.
  std::vector<MapWins> CountWins() const;
  // Returns the origins of the maps.
  std::set<AgentId> FindMapOrigins() const;
  // Returns the number of cells that are free because of footprints, by agent.
  std::map<AgentId, std::uint64_t> CountFootprintCells() const;

  // Memory use in bytes, without LocalMaps. page_bytes() counts only the pages.
  std::size_t bytes() const;
  std::size_t page_bytes() const;

 private:
  using Thing = std::unique_ptr<PlacedThing>;

  void Retire(Thing thing);
  void UpdateExtent();
  void UpdateOrder();
  void MarkDirty();
  void MarkWins(const PlacedThing& retired);
  void MarkGains(const PlacedThing& added);
  void MarkEverything();
  void FreeBuried();
  void ForgetEmptyPages();
  bool StartOver();
  void WithdrawItemsWithoutRoom();
  Page* FindPage(const PageKey& key) const;
  bool IsMostlyNew() const;
  Result<std::vector<GatherWork>> MakeWorks();
  void ObserveChanges(std::span<const GatherWork> works, MergeSummary& summary);
  // Returns the number of cells that each map or footprint wins.
  std::unordered_map<const PlacedThing*, std::uint64_t> CountCells() const;
  template <typename Visit>
  void VisitTiles(const CellBox& box, Visit visit) const;

  const MergeGrid grid_;
  const std::shared_ptr<GatherBackend> backend_;
  std::map<RecordKey, Thing> maps_;
  std::map<NodeKey, Thing> footprints_;
  // Maps and footprints added since the last Merge. Owned by maps_ or footprints_.
  std::unordered_set<PlacedThing*> added_;
  // Maps and footprints withdrawn since the last Merge. A tile points to the blocks of these maps and footprints until
  // the tile is gathered again.
  std::vector<Thing> retired_;
  // Withdrawn maps and footprints whose tiles are already in dirty_. They are freed after these tiles are gathered.
  std::vector<Thing> buried_;
  std::vector<OrderedBlock> order_;  // All blocks as of the last Merge, sorted by descending key.
  std::unordered_map<PageKey, std::unique_ptr<Page>, PageKeyHash> pages_;
  std::unordered_map<PageKey, std::uint16_t, PageKeyHash> dirty_;  // Tiles to gather, one bit each, by page.
  // True after a merge that exceeded grid_.pages_max. The next merge then gathers all tiles.
  bool is_everything_due_ = false;
  CellBox extent_;
  std::map<AgentId, std::uint64_t> without_room_;
  std::uint64_t version_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace moondb
