// Finds the maps of one agent that make many hazard cells of the other agents free. One wrong map, for example a
// costmap whose unknown cells were stored as free, can win every cell that it covers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"

namespace moondb {

// Maps of one agent from at most kClearedSpan_ns.
struct ClearedHazards {
  AgentId agent = 0;
  std::uint64_t cell_count = 0;    // Cells that are hazard without the agent's maps, and free because of these maps.
  std::uint64_t hazard_count = 0;  // Cells that are hazard without the agent's maps.
  std::int64_t from_ns = 0;        // Timestamps of the first and the last of the maps.
  std::int64_t to_ns = 0;
  std::int64_t cell_x = 0;  // One of the cells.
  std::int64_t cell_y = 0;
};

inline constexpr std::int64_t kClearedSpan_ns = 60'000'000'000;
inline constexpr double kClearedShareMax = 0.2;          // A larger share of the hazards is found.
inline constexpr std::uint64_t kClearedHazardsMin = 50;  // With fewer hazards of the others, nothing is found.
inline constexpr std::size_t kClearedAgentsMax = 8;      // Limits the number of merges.

// Returns for each agent the maps that clear the most cells, if they exceed kClearedShareMax. Merges once per agent,
// without its maps. Examines only the kClearedAgentsMax agents whose maps win the most cells. `merged`: the merged map
// of `everything`, up to date. Errors are those of Merger::Merge.
Result<std::vector<ClearedHazards>> FindClearedHazards(const MapCollection::Selected& everything, const Merger& merged,
                                                       const std::shared_ptr<GatherBackend>& backend,
                                                       const StopPredicate& stop);

}  // namespace moondb
