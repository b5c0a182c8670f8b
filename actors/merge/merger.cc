#include "actors/merge/merger.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <iterator>
#include <string>
#include <tuple>
#include <utility>

#include "actors/merge/cpu_gather.h"
#include "model/check.h"

namespace moondb {
namespace {

// Returns a table that expands eight bits to eight bytes of 0 or 1.
constexpr std::array<std::uint64_t, 256> MakeBytesOfBits() {
  std::array<std::uint64_t, 256> bytes{};
  for (std::size_t bits = 0; bits < bytes.size(); ++bits) {
    for (std::size_t i = 0; i < 8; ++i) bytes[bits] |= static_cast<std::uint64_t>(bits >> i & 1) << (8 * i);
  }
  return bytes;
}
constexpr std::array<std::uint64_t, 256> kBytesOfBits = MakeBytesOfBits();

CellBox Common(const CellBox& a, const CellBox& b) {
  return {std::max(a.first_x, b.first_x), std::max(a.first_y, b.first_y), std::min(a.last_x, b.last_x),
          std::min(a.last_y, b.last_y)};
}

// Position of a cell within its tile.
struct TileCell {
  TileCell(std::int64_t x, std::int64_t y)
      : square(static_cast<std::size_t>((y >> kSquareSideBits & 7) * 8 + (x >> kSquareSideBits & 7))),
        cell(static_cast<std::size_t>((y & 7) * 8 + (x & 7))) {}
  std::size_t square;
  std::size_t cell;
};

// Calls visit(page key, index of the tile in the page, box of the tile) for each tile that touches `box`, even if the
// tile's page does not exist.
template <typename Visit>
void ForEachTile(const CellBox& box, Visit visit) {
  if (box.is_empty()) return;
  for (std::int64_t y = box.first_y >> kTileSideBits; y <= box.last_y >> kTileSideBits; ++y) {
    for (std::int64_t x = box.first_x >> kTileSideBits; x <= box.last_x >> kTileSideBits; ++x) {
      const PageKey key = PageAt(x * kTileSideCells, y * kTileSideCells);
      const auto tile = static_cast<std::size_t>((y & 3) * 4 + (x & 3));
      visit(key, tile, BoxOf(key, tile));
    }
  }
}

MergedMap MakeUnknown(const CellBox& box, const MergeGrid& grid) {
  MergedMap merged;
  merged.grid = Grid(static_cast<std::int32_t>(box.width()), static_cast<std::int32_t>(box.height()));
  merged.resolution_um = grid.resolution_um;
  if (!box.is_empty()) {
    merged.origin_cell_x = box.first_x;
    merged.origin_cell_y = box.first_y;
  }
  return merged;
}

Result<void> CheckBox(const CellBox& box, const MergeGrid& grid) {
  if (box.width() <= grid.side_cells_max && box.height() <= grid.side_cells_max) return {};
  return Fail(ErrorCode::kFull, "the maps span " + std::to_string(box.width()) + " x " + std::to_string(box.height()) +
                                    " cells of " + std::to_string(grid.resolution_um) +
                                    " um; a merged map holds at most " + std::to_string(grid.side_cells_max) +
                                    " a side: merge fewer agents, or quarantine maps that lie far away");
}

// Copies the tile's cells in row `y`, from part.first_x to part.last_x, to `row`.
void CopyRow(const Tile& tile, const CellBox& part, std::int64_t y, Cell* row) {
  for (std::int64_t x = part.first_x; x <= part.last_x;) {
    const TileCell at(x, y);
    const int shift = static_cast<int>(at.cell & 56);
    const std::uint64_t cells =
        kBytesOfBits[tile.known[at.square] >> shift & 255] + kBytesOfBits[tile.hazard[at.square] >> shift & 255];
    const std::int64_t end = std::min((x | 7), part.last_x) + 1;
    const std::uint64_t from_x = cells >> (8 * (x & 7));
    std::memcpy(row, &from_x, static_cast<std::size_t>(end - x));
    row += end - x;
    x = end;
  }
}

std::vector<PlacedMap> WinnersOf(const std::vector<const Tile*>& tiles) {
  std::vector<const PlacedThing*> owners;
  for (const Tile* tile : tiles) {
    for (const PlacedBlock* block : tile->blocks) {
      if (!block->is_footprint()) owners.push_back(block->owner);
    }
  }
  std::sort(owners.begin(), owners.end());
  owners.erase(std::unique(owners.begin(), owners.end()), owners.end());
  std::vector<PlacedMap> maps;
  for (const PlacedThing* owner : owners) maps.push_back(owner->placed);
  std::sort(maps.begin(), maps.end(), [](const auto& a, const auto& b) { return a.map->key < b.map->key; });
  return maps;
}

// For each block in Tile::blocks: the index of its map in the list of maps (kNoSlot for a footprint), and the level of
// the block.
using Winners = std::vector<std::pair<std::uint32_t, std::uint8_t>>;

Winners SlotsOf(const Tile& tile, const std::vector<PlacedMap>& maps) {
  Winners winners;
  for (const PlacedBlock* block : tile.blocks) {
    if (block->is_footprint()) {
      winners.emplace_back(kNoSlot, kFootprintLevel);
      continue;
    }
    const RecordKey& key = block->owner->placed.map->key;
    const auto found = std::lower_bound(maps.begin(), maps.end(), key,
                                        [](const PlacedMap& map, const RecordKey& k) { return map.map->key < k; });
    winners.emplace_back(static_cast<std::uint32_t>(found - maps.begin()), block->cells->block().level);
  }
  return winners;
}

// Removes the maps that win no cell in the box of `result`. Such maps occur because tiles extend beyond the box.
void DropLosers(MergeResult& result) {
  std::vector<bool> has_won(result.maps.size());
  for (const std::uint32_t slot : result.slots) {
    if (slot != kNoSlot) has_won[slot] = true;
  }
  std::vector<std::uint32_t> new_slots(result.maps.size());
  std::vector<PlacedMap> maps;
  for (std::size_t slot = 0; slot < has_won.size(); ++slot) {
    new_slots[slot] = static_cast<std::uint32_t>(maps.size());
    if (has_won[slot]) maps.push_back(std::move(result.maps[slot]));
  }
  for (std::uint32_t& slot : result.slots) {
    if (slot != kNoSlot) slot = new_slots[slot];
  }
  result.maps = std::move(maps);
}

bool HasTile(const Page& page) {
  return std::any_of(page.tiles.begin(), page.tiles.end(), [](const auto& tile) { return tile != nullptr; });
}

}  // namespace

bool MergeResult::operator==(const MergeResult& other) const {
  const auto is_same_map = [](const PlacedMap& a, const PlacedMap& b) { return a.map->key == b.map->key; };
  return merged.grid == other.merged.grid && merged.resolution_um == other.merged.resolution_um &&
         merged.origin_cell_x == other.merged.origin_cell_x && merged.origin_cell_y == other.merged.origin_cell_y &&
         slots == other.slots && levels == other.levels &&
         std::equal(maps.begin(), maps.end(), other.maps.begin(), other.maps.end(), is_same_map);
}

Merger::Merger(const MergeGrid& grid, std::shared_ptr<GatherBackend> backend)
    : grid_(grid), backend_(std::move(backend)) {
  Check(CheckGrid(grid_).has_value(), "the grid was checked");
  Check(backend_ != nullptr, "a merger has a backend");
}

Merger::~Merger() = default;

void Merger::Retire(Thing thing) {
  if (added_.erase(thing.get()) > 0) return;  // The item was added after the last merge, so no tile refers to it.
  thing->is_retired = true;
  retired_.push_back(std::move(thing));
}

Result<void> Merger::Put(const PlacedMap& placed) {
  Thing& held = maps_[placed.map->key];
  if (held != nullptr && held->placed.map == placed.map &&
      AreSamePose(held->placed.map_from_node, placed.map_from_node)) {
    return {};
  }
  Result<Thing> thing = PlaceMap(placed, grid_);
  if (!thing) {
    if (held == nullptr) maps_.erase(placed.map->key);
    return tl::unexpected(thing.error());
  }
  if (held != nullptr) Retire(std::move(held));
  held = std::move(*thing);
  added_.insert(held.get());
  return {};
}

bool Merger::Withdraw(const RecordKey& key) {
  const auto found = maps_.find(key);
  if (found == maps_.end()) return false;
  Retire(std::move(found->second));
  maps_.erase(found);
  return true;
}

Result<void> Merger::PutFootprint(const Footprint& footprint) {
  const auto found = footprints_.find(footprint.node);
  if (found != footprints_.end() && AreSamePose(found->second->placed.map_from_node, footprint.map_from_node)) {
    return {};
  }
  Result<Thing> thing = PlaceFootprint(footprint, grid_);
  if (!thing) return tl::unexpected(thing.error());
  WithdrawFootprint(footprint.node);
  added_.insert(thing->get());
  footprints_.emplace(footprint.node, std::move(*thing));
  return {};
}

bool Merger::WithdrawFootprint(const NodeKey& node) {
  const auto found = footprints_.find(node);
  if (found == footprints_.end()) return false;
  Retire(std::move(found->second));
  footprints_.erase(found);
  return true;
}

std::vector<Error> Merger::Assign(std::span<const PlacedMap> maps, std::span<const Footprint> footprints) {
  std::map<RecordKey, const PlacedMap*> wanted_maps;
  for (const PlacedMap& placed : maps) wanted_maps.emplace(placed.map->key, &placed);
  std::map<NodeKey, const Footprint*> wanted_footprints;
  for (const Footprint& footprint : footprints) wanted_footprints.emplace(footprint.node, &footprint);

  std::vector<RecordKey> gone_maps;
  for (const auto& [key, thing] : maps_) {
    if (!wanted_maps.contains(key)) gone_maps.push_back(key);
  }
  for (const RecordKey& key : gone_maps) Withdraw(key);
  std::vector<NodeKey> gone_footprints;
  for (const auto& [node, thing] : footprints_) {
    if (!wanted_footprints.contains(node)) gone_footprints.push_back(node);
  }
  for (const NodeKey& node : gone_footprints) WithdrawFootprint(node);

  // An item that cannot be placed at its new pose is withdrawn from its old pose too.
  std::vector<Error> refused;
  for (const auto& [key, placed] : wanted_maps) {
    const Result<void> put = Put(*placed);
    if (put) continue;
    Withdraw(key);
    refused.push_back({put.error().code, "map " + ToString(key) + ": " + put.error().text, put.error().field});
  }
  for (const auto& [node, footprint] : wanted_footprints) {
    const Result<void> put = PutFootprint(*footprint);
    if (put) continue;
    WithdrawFootprint(node);
    refused.push_back({put.error().code, "footprint: " + put.error().text, put.error().field});
  }
  return refused;
}

Result<MergeSummary> Merger::Merge(const StopPredicate& stop) {
  MergeSummary summary;
  if (!added_.empty() || !retired_.empty() || is_everything_due_) {
    summary.is_full = is_everything_due_ || IsMostlyNew();
    UpdateExtent();
    UpdateOrder();
    if (summary.is_full) {
      MarkEverything();
    } else {
      MarkDirty();
    }
    added_.clear();
    std::move(retired_.begin(), retired_.end(), std::back_inserter(buried_));
    retired_.clear();
  }
  if (!dirty_.empty()) {
    Result<std::vector<GatherWork>> works = MakeWorks();
    is_everything_due_ = !works;
    if (!works) {
      dirty_.clear();
      FreeBuried();
      return tl::unexpected(works.error());
    }
    ++version_;
    const Result<void> gathered = backend_->Gather(order_, *works, stop);
    NoteChanges(*works, summary);
    if (!gathered) return tl::unexpected(gathered.error());
    dirty_.clear();
  }
  buried_.clear();
  summary.version = version_;
  return summary;
}

// Returns true if gathering all tiles is cheaper than finding the affected tiles. With many changes, the search would
// examine the same tile many times. Examining a tile costs about 1/16 of gathering it.
bool Merger::IsMostlyNew() const {
  const std::size_t changes = added_.size() + retired_.size();
  if (changes > 8 && changes > (maps_.size() + footprints_.size()) / 2) return true;
  std::int64_t looks = 0;
  const auto count = [&looks](const PlacedThing& thing) {
    looks += (thing.extent.width() / kTileSideCells + 1) * (thing.extent.height() / kTileSideCells + 1);
  };
  for (const PlacedThing* thing : added_) count(*thing);
  for (const Thing& thing : retired_) count(*thing);
  constexpr std::int64_t kLooksForATile = 16;
  return changes > 8 && looks > kLooksForATile * static_cast<std::int64_t>(pages_.size() * kTilesInPage);
}

void Merger::UpdateExtent() {
  if (retired_.empty()) {
    for (const PlacedThing* thing : added_) extent_.Add(thing->extent);
    return;
  }
  extent_ = {};
  for (const auto& [key, thing] : maps_) extent_.Add(thing->extent);
  for (const auto& [node, thing] : footprints_) extent_.Add(thing->extent);
}

void Merger::UpdateOrder() {
  if (!retired_.empty()) {
    std::erase_if(order_, [](const OrderedBlock& ordered) { return ordered.block->owner->is_retired; });
  }
  const auto first_added = static_cast<std::ptrdiff_t>(order_.size());
  for (PlacedThing* thing : added_) {
    for (PlacedBlock& block : thing->blocks) order_.push_back({block.rectangle.box, &block});
  }
  const auto above = [](const OrderedBlock& a, const OrderedBlock& b) { return StandsAbove(*a.block, *b.block); };
  std::sort(order_.begin() + first_added, order_.end(), above);
  std::inplace_merge(order_.begin(), order_.begin() + first_added, order_.end(), above);
  std::uint32_t rank = 0;
  for (const OrderedBlock& ordered : order_) ordered.block->rank = rank++;
}

void Merger::MarkDirty() {
  for (const Thing& thing : retired_) MarkWins(*thing);
  for (const PlacedThing* thing : added_) {
    // With more than kPagesMax dirty pages, MakeWorks fails. Stop early.
    if (dirty_.size() > kPagesMax) return;
    MarkGains(*thing);
  }
}

// Frees the withdrawn maps and footprints in buried_, except those that a tile still refers to.
void Merger::FreeBuried() {
  std::unordered_set<const PlacedThing*> named;
  for (const auto& [key, page] : pages_) {
    for (const std::unique_ptr<Tile>& tile : page->tiles) {
      if (tile == nullptr) continue;
      for (const PlacedBlock* block : tile->blocks) named.insert(block->owner);
    }
  }
  std::erase_if(buried_, [&named](const Thing& thing) { return !named.contains(thing.get()); });
}

// Drops pages without a known cell.
void Merger::ForgetEmptyPages() {
  std::erase_if(pages_, [](const auto& entry) { return !HasTile(*entry.second); });
  ++forgotten_;
}

// Marks the tiles in which `retired` won a cell.
void Merger::MarkWins(const PlacedThing& retired) {
  ForEachTile(retired.extent, [&](const PageKey& key, std::size_t index, const CellBox&) {
    const Page* page = FindPage(key);
    if (page == nullptr || page->tiles[index] == nullptr) return;
    const auto& blocks = page->tiles[index]->blocks;
    const auto is_its = [&retired](const PlacedBlock* block) { return block->owner == &retired; };
    if (std::any_of(blocks.begin(), blocks.end(), is_its)) dirty_[key] |= static_cast<std::uint16_t>(1 << index);
  });
}

// Marks the tiles in which `added` may win a cell.
void Merger::MarkGains(const PlacedThing& added) {
  for (const PlacedBlock& block : added.blocks) {
    ForEachTile(block.rectangle.box, [&](const PageKey& key, std::size_t index, const CellBox& box) {
      const auto bit = static_cast<std::uint16_t>(1 << index);
      const auto dirty = dirty_.find(key);
      if (dirty != dirty_.end() && (dirty->second & bit) != 0) return;
      const Page* page = FindPage(key);
      const Tile* tile = page == nullptr ? nullptr : page->tiles[index].get();
      if (WouldWinIn(block, box, tile)) dirty_[key] |= bit;
    });
  }
}

void Merger::MarkEverything() {
  for (const auto& [key, page] : pages_) {
    if (HasTile(*page)) dirty_[key] = UINT16_MAX;
  }
  for (const OrderedBlock& ordered : order_) {
    // With more than kPagesMax dirty pages, MakeWorks fails. Stop early.
    if (dirty_.size() > kPagesMax) return;
    const CellBox& box = ordered.box;
    const PageKey first = PageAt(box.first_x, box.first_y);
    const PageKey last = PageAt(box.last_x, box.last_y);
    for (std::int64_t y = first.y; y <= last.y; ++y) {
      for (std::int64_t x = first.x; x <= last.x; ++x) {
        dirty_[{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)}] = UINT16_MAX;
      }
    }
  }
}

Page* Merger::FindPage(const PageKey& key) const {
  const auto found = pages_.find(key);
  return found == pages_.end() ? nullptr : found->second.get();
}

// Returns one work item per dirty page. Items of neighbouring pages are adjacent, because backends cache the block list
// of a region of pages.
Result<std::vector<GatherWork>> Merger::MakeWorks() {
  const auto is_new = [this](const auto& dirty) { return !pages_.contains(dirty.first); };
  const auto count_pages = [&] {
    return pages_.size() + static_cast<std::size_t>(std::count_if(dirty_.begin(), dirty_.end(), is_new));
  };
  if (count_pages() > kPagesMax) ForgetEmptyPages();
  if (count_pages() > kPagesMax) {
    return Fail(ErrorCode::kFull, "the maps cover more than " + std::to_string(kPagesMax) +
                                      " pages of 256 x 256 cells: merge fewer agents or coarser");
  }
  std::vector<GatherWork> works;
  works.reserve(dirty_.size());
  for (const auto& [key, tiles] : dirty_) {
    std::unique_ptr<Page>& page = pages_[key];
    if (page == nullptr) page = std::make_unique<Page>();
    works.push_back({key, page.get(), tiles, 0});
  }
  const auto place = [](const GatherWork& work) {
    return std::tuple(work.key.y >> 3, work.key.x >> 3, work.key.y, work.key.x);
  };
  std::sort(works.begin(), works.end(), [&](const auto& a, const auto& b) { return place(a) < place(b); });
  return works;
}

void Merger::NoteChanges(std::span<const GatherWork> works, MergeSummary& summary) {
  for (const GatherWork& work : works) {
    summary.gathered_tiles += static_cast<std::size_t>(std::popcount(work.tiles));
    summary.changed_tiles += static_cast<std::size_t>(std::popcount(work.changed));
    for (std::size_t tile = 0; tile < kTilesInPage; ++tile) {
      if ((work.changed >> tile & 1) != 0) work.page->versions[tile] = version_;
    }
    const auto is_nothing = [](std::uint64_t version) { return version == 0; };
    if (std::all_of(work.page->versions.begin(), work.page->versions.end(), is_nothing)) pages_.erase(work.key);
  }
}

// Calls visit(tile, part of `box` in the tile) for each existing tile that touches `box`.
template <typename Visit>
void Merger::VisitTiles(const CellBox& box, Visit visit) const {
  ForEachTile(box, [&](const PageKey& key, std::size_t index, const CellBox& tile_box) {
    const Page* page = FindPage(key);
    if (page != nullptr && page->tiles[index] != nullptr) visit(*page->tiles[index], Common(tile_box, box));
  });
}

Result<MergedMap> Merger::ReadCells(const CellBox& box) const {
  if (Result<void> checked = CheckBox(box, grid_); !checked) return tl::unexpected(checked.error());
  MergedMap merged = MakeUnknown(box, grid_);
  VisitTiles(box, [&](const Tile& tile, const CellBox& part) {
    for (std::int64_t y = part.first_y; y <= part.last_y; ++y) {
      CopyRow(tile, part, y,
              &merged.grid.At(static_cast<std::int32_t>(part.first_x - box.first_x),
                              static_cast<std::int32_t>(y - box.first_y)));
    }
  });
  return merged;
}

Result<MergeResult> Merger::Read(const CellBox& box) const {
  Result<MergedMap> merged = ReadCells(box);
  if (!merged) return tl::unexpected(merged.error());
  MergeResult result;
  result.merged = std::move(*merged);
  result.slots.assign(result.merged.grid.cells.size(), kNoSlot);
  result.levels.assign(result.merged.grid.cells.size(), 0);
  std::vector<const Tile*> tiles;
  VisitTiles(box, [&](const Tile& tile, const CellBox&) { tiles.push_back(&tile); });
  std::vector<PlacedMap> maps = WinnersOf(tiles);
  VisitTiles(box, [&](const Tile& tile, const CellBox& part) {
    const Winners winners = SlotsOf(tile, maps);
    for (std::int64_t y = part.first_y; y <= part.last_y; ++y) {
      auto to = static_cast<std::size_t>((y - box.first_y) * box.width() + part.first_x - box.first_x);
      for (std::int64_t x = part.first_x; x <= part.last_x; ++x, ++to) {
        const TileCell at(x, y);
        if ((tile.known[at.square] >> at.cell & 1) == 0) continue;
        std::tie(result.slots[to], result.levels[to]) = winners[tile.winners[at.square * 64 + at.cell]];
      }
    }
  });
  result.maps = std::move(maps);
  DropLosers(result);
  return result;
}

std::vector<TileKey> Merger::ChangedSince(std::uint64_t version) const {
  std::vector<TileKey> changed;
  for (const auto& [key, page] : pages_) {
    for (std::size_t tile = 0; tile < kTilesInPage; ++tile) {
      if (page->versions[tile] > version) changed.push_back({key, static_cast<std::uint8_t>(tile)});
    }
  }
  std::sort(changed.begin(), changed.end());
  return changed;
}

std::vector<Observation> Merger::Observe(std::int64_t x, std::int64_t y) const {
  std::vector<Observation> seen;
  for (const OrderedBlock& ordered : order_) {
    const Cell cell = CellUnder(*ordered.block, x, y);
    if (cell == Cell::kUnknown) continue;
    const PlacedThing& owner = *ordered.block->owner;
    Observation observation;
    observation.placed = owner.placed;
    observation.node = ordered.block->is_footprint() ? owner.node : owner.placed.map->node;
    if (!ordered.block->is_footprint()) observation.level = ordered.block->cells->block().level;
    observation.resolution_um = ordered.block->resolution_um;
    observation.cell = cell;
    seen.push_back(std::move(observation));
  }
  return seen;
}

std::unordered_map<const PlacedThing*, std::uint64_t> Merger::CountCells() const {
  std::unordered_map<const PlacedThing*, std::uint64_t> cells;
  for (const auto& [key, page] : pages_) {
    for (const std::unique_ptr<Tile>& tile : page->tiles) {
      if (tile == nullptr) continue;
      std::vector<std::uint64_t> wins(tile->blocks.size());
      for (std::size_t i = 0; i < kCellsInTile; ++i) {
        if ((tile->known[i / 64] >> (i % 64) & 1) != 0) ++wins[tile->winners[i]];
      }
      for (std::size_t i = 0; i < wins.size(); ++i) cells[tile->blocks[i]->owner] += wins[i];
    }
  }
  return cells;
}

std::vector<MapWins> Merger::CountWins() const {
  const std::unordered_map<const PlacedThing*, std::uint64_t> cells = CountCells();
  std::vector<MapWins> result;
  for (const auto& [key, thing] : maps_) {
    const auto found = cells.find(thing.get());
    result.push_back({thing->placed, found == cells.end() ? 0 : found->second});
  }
  return result;
}

std::map<AgentId, std::uint64_t> Merger::CountFootprintCells() const {
  std::map<AgentId, std::uint64_t> result;
  for (const auto& [thing, cells] : CountCells()) {
    if (thing->placed.map == nullptr) result[thing->node.agent] += cells;
  }
  return result;
}

std::size_t Merger::page_bytes() const {
  std::size_t bytes = pages_.size() * (sizeof(Page) + 64);
  for (const auto& [key, page] : pages_) {
    for (const std::unique_ptr<Tile>& tile : page->tiles) {
      if (tile != nullptr) bytes += sizeof(Tile) + tile->blocks.capacity() * sizeof(const PlacedBlock*);
    }
  }
  return bytes;
}

std::size_t Merger::bytes() const {
  std::size_t bytes = page_bytes() + order_.capacity() * sizeof(OrderedBlock);
  for (const auto& [key, thing] : maps_) {
    bytes += sizeof(PlacedThing) + 64 + thing->blocks.capacity() * sizeof(PlacedBlock);
  }
  return bytes + footprints_.size() * (sizeof(PlacedThing) + sizeof(PlacedBlock) + 64);
}

}  // namespace moondb
