#include "actors/merge/cleared_hazards.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace moondb {

namespace {

// The cleared cells of one map.
struct ClearedBy {
  std::int64_t timestamp_ns = 0;
  std::uint64_t cell_count = 0;
  std::int64_t cell_x = 0;
  std::int64_t cell_y = 0;
};

using ClearedByMap = std::map<RecordKey, ClearedBy>;

// Counts the hazards of `without` in one tile, and adds those that a map of `agent` makes free in `merged`.
Result<std::uint64_t> CountTile(const CellBox& box, AgentId agent, const Merger& without, const Merger& merged,
                                ClearedByMap& cleared) {
  const Result<MergedMap> others = without.ReadCells(box);
  if (!others) return tl::unexpected(others.error());
  const Result<MergeResult> all = merged.Read(box);
  if (!all) return tl::unexpected(all.error());
  std::uint64_t hazard_count = 0;
  for (std::size_t i = 0; i < others->grid.cells.size(); ++i) {
    if (others->grid.cells[i] != Cell::kHazard) continue;
    ++hazard_count;
    const std::uint32_t slot = all->slots[i];
    if (all->merged.grid.cells[i] != Cell::kFree || slot == kNoSlot) continue;
    const LocalMap& winner = *all->maps[slot].map;
    if (winner.agent() != agent) continue;
    ClearedBy& by = cleared[winner.key];
    ++by.cell_count;
    by.timestamp_ns = winner.timestamp_ns;
    by.cell_x = box.first_x + static_cast<std::int64_t>(i) % box.width();
    by.cell_y = box.first_y + static_cast<std::int64_t>(i) / box.width();
  }
  return hazard_count;
}

// Returns the maps within kClearedSpan_ns that together clear the most cells.
ClearedHazards FindMost(const ClearedByMap& cleared) {
  std::vector<ClearedBy> maps;
  for (const auto& [key, by] : cleared) maps.push_back(by);
  std::sort(maps.begin(), maps.end(), [](const auto& a, const auto& b) { return a.timestamp_ns < b.timestamp_ns; });
  ClearedHazards most;
  std::uint64_t count = 0;
  auto first = maps.begin();
  for (auto last = maps.begin(); last != maps.end(); ++last) {
    count += last->cell_count;
    // Maps of unknown age have the smallest timestamp; the difference then does not overflow an unsigned number.
    while (static_cast<std::uint64_t>(last->timestamp_ns) - static_cast<std::uint64_t>(first->timestamp_ns) >
           static_cast<std::uint64_t>(kClearedSpan_ns)) {
      count -= (first++)->cell_count;
    }
    if (count <= most.cell_count) continue;
    most.cell_count = count;
    most.from_ns = first->timestamp_ns;
    most.to_ns = last->timestamp_ns;
    most.cell_x = last->cell_x;
    most.cell_y = last->cell_y;
  }
  return most;
}

// Returns the kClearedAgentsMax agents whose maps win the most cells, ascending.
std::set<AgentId> FindLargest(const Merger& merged) {
  std::map<AgentId, std::uint64_t> cells;
  for (const MapWins& wins : merged.CountWins()) cells[wins.placed.map->agent()] += wins.cells;
  std::vector<std::pair<std::uint64_t, AgentId>> order;
  for (const auto& [agent, count] : cells) order.emplace_back(count, agent);
  std::sort(order.rbegin(), order.rend());
  std::set<AgentId> largest;
  for (std::size_t i = 0; i < std::min(order.size(), kClearedAgentsMax); ++i) largest.insert(order[i].second);
  return largest;
}

}  // namespace

Result<std::vector<ClearedHazards>> FindClearedHazards(const MapCollection::Selected& everything, const Merger& merged,
                                                       const std::shared_ptr<GatherBackend>& backend,
                                                       const StopPredicate& stop) {
  std::vector<ClearedHazards> found;
  if (merged.FindMapOrigins().size() < 2) return found;
  for (const AgentId agent : FindLargest(merged)) {
    MapCollection::Selected others = everything;
    std::erase_if(others.maps, [agent](const PlacedMap& map) { return map.map->agent() == agent; });
    Merger without(merged.grid(), backend);
    (void)without.Assign(others.maps, others.footprints);
    if (const Result<MergeSummary> done = without.Merge(stop); !done) return tl::unexpected(done.error());
    ClearedByMap cleared;
    std::uint64_t hazard_count = 0;
    for (const TileKey& tile : without.ChangedSince(0)) {
      const Result<std::uint64_t> counted = CountTile(BoxOf(tile.page, tile.tile), agent, without, merged, cleared);
      if (!counted) return tl::unexpected(counted.error());
      hazard_count += *counted;
    }
    ClearedHazards most = FindMost(cleared);
    most.agent = agent;
    most.hazard_count = hazard_count;
    const bool is_much = static_cast<double>(most.cell_count) > kClearedShareMax * static_cast<double>(hazard_count);
    if (hazard_count >= kClearedHazardsMin && is_much) found.push_back(most);
  }
  return found;
}

}  // namespace moondb
