// MergeMaps: a single merge of given maps and poses, for programs that have no store (scoring, tools, tests).
//
//   std::vector<MapAtPose> maps;
//   for (const MissionMap& map : mission.maps) {
//     const RecordKey key = NumberedMapKey(map.agent, maps.size() + 1);
//     maps.push_back({key, map.timestamp_ns, mission.truth.at(map.node), *ReadMissionMap(mission, map)});
//   }
//   const Result<MergedMap> merged = MergeMaps(maps, footprints, {});
#pragma once

#include <span>

#include "actors/merge/gather_backend.h"
#include "actors/merge/local_map.h"
#include "model/error.h"

namespace moondb {

struct MapAtPose {
  RecordKey key;  // Identifies the map. Breaks ties if resolution, timestamp and agent are equal.
  std::int64_t timestamp_ns = 0;
  Pose map_from_node;
  TraversabilityMap map;
};

struct MergeOptions {
  MergeGrid grid;
  MergeBackend backend = MergeBackend::kAuto;
};

// Returns a key for a map that is not a stored record: map number `seq` (from 1) of the agent.
RecordKey NumberedMapKey(AgentId agent, std::uint64_t seq);

// Merges the maps and footprints. `footprints` are rover poses (map_from_node); the cells under the rover's body become
// free. Errors are those of CheckGrid, MakeLocalMap, CreateGatherBackend and Merger.
Result<MergedMap> MergeMaps(std::span<const MapAtPose> maps, std::span<const Pose> footprints,
                            const MergeOptions& options);

}  // namespace moondb
