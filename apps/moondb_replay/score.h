// How good what an agent made of a mission is: trajectories and merged maps at raw and at optimized poses, against the
// truth that no agent ever saw.
//
// All maps are merged here anew, from the records that the agent holds; that its own merged map is the same, byte for
// byte, is one of the results. Plain functions on plain values.
#pragma once

#include <vector>

#include "actors/merge/merge_maps.h"
#include "apps/common/graph_reading.h"
#include "client/client.h"
#include "model/error.h"
#include "model/metrics.h"
#include "model/mission.h"
#include "proto/team.pb.h"

namespace moondb {

// One stored map, as the agent holds it.
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
Poses NewestPoses(const Held& held);

// Maps whose node has a pose, and the footprints of the rovers' nodes; of one rover only where `only` is not 0.
Result<MergedMap> MergeAt(const proto::TeamConfig& team, const Held& held, const Poses& poses, AgentId only = 0);

struct Score {
  TrajectoryError before;
  TrajectoryError after;
  MapAgreement map_before;
  MapAgreement map_after;
  std::size_t map_count = 0;
  std::size_t optimized_count = 0;
  bool is_agents_map_equal = false;  // The agent's own merged map is the one merged here.
};

// The merged maps that a score was made of.
struct ScoredMaps {
  MergedMap before;
  MergedMap after;
  MergedMap truth;
};

struct Scored {
  Score score;
  ScoredMaps maps;
};

// `agents_map` is what the agent merged itself. kNotFound if the agent holds no node of the mission, or no map.
Result<Scored> ScoreHeld(const proto::TeamConfig& team, const Mission& mission, const Held& held,
                         const MergedMap& agents_map);

}  // namespace moondb
