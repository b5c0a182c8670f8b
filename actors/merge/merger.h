// Merger: keeps one merged map of three values up to date (paper, Section 5), and knows for each cell where its value
// came from.
//
// Put, move and withdraw maps and footprints in any order, as often as liked; Merge() then gathers again the tiles in
// which that can make a difference, or all of them if most has changed. The result depends on what is put in alone,
// never on the order, on what was merged before, or on the backend: the same bytes for value and provenance.
//
// The world is unbounded: only tiles with a known cell, and pages that had one, take memory, and cells are counted in
// int64. All state is here; the backend's can be lost at any time. LocalMaps are shared by all mergers that hold them.
//
//   Merger merger(grid, *CreateGatherBackend(MergeBackend::kAuto));
//   merger.Put({local_map, map_from_node});
//   merger.PutFootprint({node, map_from_node});
//   merger.Merge({});
//   const MergedMap map = *merger.ReadCells(merger.extent());
//
// Used by one thread at a time. Reads show the last successful Merge(): what was put since then is not in them yet, and
// after a failed one they may be partly old.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "actors/merge/gather_backend.h"
#include "actors/merge/placement.h"
#include "actors/merge/tile.h"
#include "model/error.h"
#include "model/grid.h"

namespace moondb {

// Levels are layers of the winning map, 0 the finest.
inline constexpr std::uint8_t kFootprintLevel = 255;

// For no map.
inline constexpr std::uint32_t kNoSlot = UINT32_MAX;

// A thousand million cells, 2.5 GB.
inline constexpr std::size_t kPagesMax = 16384;

// A region with its provenance.
struct MergeResult {
  MergedMap merged;
  // Row by row like merged.grid.cells. An unknown cell has kNoSlot and level 0, a footprint kNoSlot and
  // kFootprintLevel; others name `maps`.
  std::vector<std::uint32_t> slots;
  std::vector<std::uint8_t> levels;
  std::vector<PlacedMap> maps;  // Those that win a cell here, by record key, at the poses that were used.

  bool operator==(const MergeResult& other) const;  // Maps by their keys.
};

// What one map or footprint says of a cell.
struct Observation {
  PlacedMap placed;  // No map: a footprint.
  NodeKey node;      // Of the map or footprint.
  std::uint8_t level = kFootprintLevel;
  std::uint32_t resolution_um = 0;
  Cell cell = Cell::kUnknown;
};

// A map and the cells that it gives their values.
struct MapWins {
  PlacedMap placed;
  std::uint64_t cells = 0;  // May be 0.
};

struct TileKey {
  PageKey page;
  std::uint8_t tile = 0;  // Row after row, 4 a row.
  auto operator<=>(const TileKey&) const = default;
};

struct MergeSummary {
  std::uint64_t version = 0;
  std::size_t gathered_tiles = 0;
  std::size_t changed_tiles = 0;  // Gathered tiles with another value somewhere.
  bool is_full = false;           // Most had changed: everything was gathered.
};

class Merger {
 public:
  // `grid` is checked (CheckGrid); the backend may serve other mergers too.
  Merger(const MergeGrid& grid, std::shared_ptr<GatherBackend> backend);
  ~Merger();

  // A map that is new or elsewhere now; a key stands for one map. Errors as in PlaceMap; nothing changes then.
  Result<void> Put(const PlacedMap& placed);

  // False if there is none of that key.
  bool Withdraw(const RecordKey& key);

  // The ground under a rover at a node is free; errors as in Put.
  Result<void> PutFootprint(const Footprint& footprint);
  bool WithdrawFootprint(const NodeKey& node);

  // Exactly these from now on: puts what is new or elsewhere, withdraws what is missing. Of several of one key or node
  // the first counts. Returns why some were left out, as in Put.
  std::vector<Error> Assign(std::span<const PlacedMap> maps, std::span<const Footprint> footprints);

  // Brings the tiles up to date. On an error they are partly old, and the next Merge() does the rest. Errors as in
  // GatherBackend::Gather, and kFull for more than kPagesMax.
  Result<MergeSummary> Merge(const StopPredicate& stop);

  // Of all maps' cells, unknown ones too, and footprints.
  const CellBox& extent() const { return extent_; }
  // How often places where nothing is known any more were forgotten, as there were too many: of those ChangedSince says
  // nothing.
  std::uint64_t forgotten() const { return forgotten_; }
  // Counts the merges that gathered something.
  std::uint64_t version() const { return version_; }
  std::size_t map_count() const { return maps_.size(); }
  const MergeGrid& grid() const { return grid_; }
  const GatherBackend& backend() const { return *backend_; }

  // Any box, also where nothing is known. kFull beyond grid.side_cells_max.
  Result<MergedMap> ReadCells(const CellBox& box) const;
  Result<MergeResult> Read(const CellBox& box) const;

  // Tiles with a value that a merge after `version` changed, sorted; ReadCells(BoxOf(key.page, key.tile)) reads one.
  std::vector<TileKey> ChangedSince(std::uint64_t version) const;

  // All known observations of a cell, the one that won first.
  std::vector<Observation> Observe(std::int64_t x, std::int64_t y) const;

  // Of all maps, by record key.
  std::vector<MapWins> CountWins() const;
  // Cells that are free as footprints of an agent's nodes.
  std::map<AgentId, std::uint64_t> CountFootprintCells() const;

  // In memory, LocalMaps not counted: all of it, and the pages' part.
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
  Page* FindPage(const PageKey& key) const;
  bool IsMostlyNew() const;
  Result<std::vector<GatherWork>> MakeWorks();
  void NoteChanges(std::span<const GatherWork> works, MergeSummary& summary);
  // By what won them.
  std::unordered_map<const PlacedThing*, std::uint64_t> CountCells() const;
  template <typename Visit>
  void VisitTiles(const CellBox& box, Visit visit) const;

  const MergeGrid grid_;
  const std::shared_ptr<GatherBackend> backend_;
  std::map<RecordKey, Thing> maps_;
  std::map<NodeKey, Thing> footprints_;
  std::unordered_set<PlacedThing*> added_;  // Since the last Merge; in maps_ or footprints_.
  std::vector<Thing> retired_;              // The same; tiles point to their blocks until they are gathered.
  std::vector<Thing> buried_;               // Retired, and their tiles are marked; freed when those are gathered.
  std::vector<OrderedBlock> order_;         // All blocks as of the last Merge.
  std::unordered_map<PageKey, std::unique_ptr<Page>, PageKeyHash> pages_;
  std::unordered_map<PageKey, std::uint16_t, PageKeyHash> dirty_;  // Tiles to gather.
  bool is_everything_due_ = false;                                 // After a merge that was too large.
  CellBox extent_;
  std::uint64_t version_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace moondb
