// MergeMaps: one merge from plain values, for programs that hold maps and poses themselves (scoring, tools, tests).
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
  RecordKey key;  // Names the map; the last word where resolution, stamp and agent are equal.
  std::int64_t timestamp_ns = 0;
  Pose map_from_node;
  TraversabilityMap map;
};

struct MergeOptions {
  MergeGrid grid;
  MergeBackend backend = MergeBackend::kAuto;
};

// A key for maps that never were records, such as a mission's: the agent's map number `seq` (from 1).
RecordKey NumberedMapKey(AgentId agent, std::uint64_t seq);

// `footprints` are the rovers' poses (map_from_node) that free the ground under them. Errors as in CheckGrid,
// MakeLocalMap, CreateGatherBackend and Merger.
Result<MergedMap> MergeMaps(std::span<const MapAtPose> maps, std::span<const Pose> footprints,
                            const MergeOptions& options);

}  // namespace moondb
