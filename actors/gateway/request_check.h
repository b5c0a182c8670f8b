// What a client's requests may hold before any actor sees them; actors/gateway/command_table.h says which rule is
// whose.
//
// Records' own fields are StorageActor's to check (model/record_check.h), a lease's LeaseActor's; here stand the rules
// that need the team: that the agents that a request names are members. Plain functions, any thread.
#pragma once

#include "model/control_request.h"
#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr int kClientInsertRecordsMax = 4096;
inline constexpr std::uint32_t kReadRecordsMax = 1024;
inline constexpr std::uint32_t kReadRecordsDefault = 256;
inline constexpr std::uint32_t kReadContentBytesMax = 8 * 1024 * 1024;
inline constexpr std::uint32_t kRelayedContentBytesMax = 64 * 1024;
inline constexpr std::uint32_t kReadContentBytesDefault = 1024 * 1024;
inline constexpr int kFilterEntriesMax = 1024;
inline constexpr double kMapCoordinateMax_m = 1e9;
inline constexpr double kMapWaitMax_s = 60;
inline constexpr int kCovariancesMax = 64;
inline constexpr double kMapTileMax = 1e10;  // Column and row of a tile.

// Whether the request is for this team, by its id; one that names none is. kRefused with the beginnings of both ids,
// kInvalid for what is no id.
Result<void> CheckTeamOf(const proto::ControlRequest& request, const proto::TeamConfig& team);
// kInvalid where it is for an agent that is not of the team.
Result<void> CheckForAgent(const proto::TeamConfig& team, const proto::ControlRequest& request);

// The rule of each request that has one. kInvalid, with the field named as in
// "insert.records[3].pose_graph_node.node.agent_id", for
//   an insert without records, with too many, with one that only agents themselves insert (events, roles, optimised
//   poses, verdicts), that names an agent that is not of the team, or whose numbers no robot measures: a temperature
//   below absolute zero, a quaternion whose length is not 1 within 1 %, coordinates beyond 1e9 m;
Result<void> CheckInsert(const proto::TeamConfig& team, const proto::InsertRequest& insert);
//   a read with a filter that is too long, a wait beyond kReadWaitMax_s, or one for older records or for history;
Result<void> CheckRead(const proto::ReadRequest& read);
//   a role change that changes nothing, names agents or terms that are not the team's, a reason that is too long, or a
//   wait beyond kOrderWaitMax_s;
Result<void> CheckRoleSet(const proto::TeamConfig& team, const proto::RoleSetRequest& set);
//   a share without a kind, to `self`, to or from agents that are not of the team, with another agent's order, or a
//   wait beyond kOrderWaitMax_s;
Result<void> CheckShare(const proto::TeamConfig& team, AgentId self, const proto::ShareRequest& share);
//   a question about an order without a kind, or a wait beyond kReadWaitMax_s;
Result<void> CheckShareProgress(const proto::ShareProgressRequest& progress);
//   a window that is to begin from scratch, too many covariances, or those of agents that are not of the team;
Result<void> CheckOptimize(const proto::TeamConfig& team, const proto::OptimizeRequest& optimize);
//   a merge of agents that are not of the team;
Result<void> CheckMerge(const proto::TeamConfig& team, const proto::MergeRequest& merge);
//   a place beyond kMapCoordinateMax_m;
Result<void> CheckMapWhy(const proto::MapWhyRequest& why);
//   a region that ends before it begins, no tile, a wait beyond kMapWaitMax_s;
Result<void> CheckMapTiles(const proto::MapTilesRequest& tiles);
//   a prune with negative limits, with too many types, or with any of them, or history, beside beaten maps;
Result<void> CheckPrune(const proto::PruneOrder& prune);
//   an acknowledgment without a stamp.
Result<void> CheckAcknowledge(const proto::AcknowledgeRequest& acknowledge);

// Brings the limits of a page into 1 to the maximum; 0 becomes the default. `is_relayed`: the page crosses the radio.
void BoundPage(proto::ReadRequest& request, bool is_relayed = false);

}  // namespace moondb
