// Scores an agent's results on a mission: compares the trajectories and the merged maps with the truth, which no agent
// has seen. Scores the results with raw poses and the results with optimized poses separately.
//
// Merges all maps again from the records that the agent holds. Also checks whether the agent's own merged map is
// byte-identical to the map merged here at the newest poses.
#pragma once

#include <optional>
#include <vector>

#include "actors/merge/merge_maps.h"
#include "apps/common/graph_reading.h"
#include "client/client.h"
#include "model/error.h"
#include "model/metrics.h"
#include "model/mission.h"
#include "proto/team.pb.h"

namespace moondb {

// A map that the agent stores.
struct HeldMap {
  RecordKey key;
  std::int64_t timestamp_ns = 0;
  TraversabilityMap map;
};

struct Held {
  KnownGraph graph;
  std::vector<HeldMap> maps;
};

Result<Held> ReadHeld(Client& client, const proto::TeamConfig& team);

using Poses = std::map<NodeKey, Pose>;

Poses RawPoses(const Held& held);

// Merges the held maps whose node has a pose in `poses`, and the footprints of the rovers' nodes. If `only` is not 0,
// uses only this rover's maps and nodes.
Result<MergedMap> MergeAt(const proto::TeamConfig& team, const Held& held, const Poses& poses, AgentId only = 0);

// The held maps merged at some poses, compared with the truth.
struct ScoredPoses {
  Poses poses;
  TrajectoryError error;
  MapAgreement agreement;
  MergedMap map;
};

struct Scored {
  ScoredPoses before;  // At the poses from odometry.
  // At the poses of a solve without map matches, which is done here. Absent if the agent holds no match, and if the
  // poses are aligned, because nothing but matches joins a team without starts.
  std::optional<ScoredPoses> without_matches;
  ScoredPoses after;  // At the newest poses.
  MergedMap truth;
  std::size_t map_count = 0;
  std::size_t optimized_count = 0;
  // The part of the area that all robots' maps of the whole mission show, which `after.map` shows too.
  double area_ratio = 0;
  bool is_agents_map_equal = false;  // The agent's own merged map equals `after.map`.
};

// Scores the records that an agent holds. `agents_map` is the map that the agent merged itself. `is_aligned`: moves the
// poses of each stage, all rovers together, in the plane to where they fit the truth best. Returns kNotFound if the
// agent holds no node of the mission, or no map.
Result<Scored> ScoreHeld(const proto::TeamConfig& team, const Mission& mission, const Held& held,
                         const MergedMap& agents_map, bool is_aligned);

}  // namespace moondb
