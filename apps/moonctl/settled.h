// Says whether a team in which records flow by themselves (radio.sync_period_s) is quiescent. Thread-safe.
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/ids.h"
#include "proto/graph.pb.h"
#include "proto/registration.pb.h"
#include "proto/share_status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Reports of the agents.
struct TeamActivity {
  std::set<AgentId> away;                                       // Agents that do not answer.
  std::vector<std::pair<AgentId, proto::ShareStatus>> sharing;  // By sender; of SyncActor and ReplicaActor together.
  proto::GraphStatsReply graph;                                 // The leader's.
  proto::RegistrationReply registration;                        // The leader's.
};

// Returns why the team is not quiescent: "rover2 is sending records to rover1, 45 left", "a solve of the pose graph is
// due". Names what the others still do before it names an agent that is away, because records wait for that agent until
// it comes back. Empty: each agent has got the records that roles and policies bring it, and the leader has nothing to
// solve or match.
std::string WhyNotSettled(const proto::TeamConfig& team, const TeamActivity& activity);

}  // namespace moondb
