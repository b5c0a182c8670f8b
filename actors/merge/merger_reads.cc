#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <tuple>
#include <utility>

#include "actors/merge/merger.h"

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
                                    " um; a merged map has at most " + std::to_string(grid.side_cells_max) +
                                    " cells a side: merge fewer agents, or quarantine maps that lie far away");
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

}  // namespace

bool MergeResult::operator==(const MergeResult& other) const {
  const auto is_same_map = [](const PlacedMap& a, const PlacedMap& b) { return a.map->key == b.map->key; };
  return merged.grid == other.merged.grid && merged.resolution_um == other.merged.resolution_um &&
         merged.origin_cell_x == other.merged.origin_cell_x && merged.origin_cell_y == other.merged.origin_cell_y &&
         slots == other.slots && levels == other.levels &&
         std::equal(maps.begin(), maps.end(), other.maps.begin(), other.maps.end(), is_same_map);
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

Crop Merger::CropTo(std::int64_t area_cells_max) const {
  std::vector<CropItem> items;
  items.reserve(maps_.size() + footprints_.size());
  for (const auto& [key, thing] : maps_) items.push_back({key.stream.origin, thing->extent});
  for (const auto& [node, thing] : footprints_) items.push_back({node.agent, thing->extent});
  return CropToFit(std::move(items), grid_.side_cells_max, area_cells_max);
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
    result.push_back({thing->placed, found == cells.end() ? 0 : found->second, thing->extent});
  }
  return result;
}

std::set<AgentId> Merger::FindMapOrigins() const {
  std::set<AgentId> origins;
  for (const auto& [key, thing] : maps_) origins.insert(key.stream.origin);
  return origins;
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
