// Validation of client requests before they reach an actor. actors/gateway/command_table.h maps requests to these
// rules.
//
// Agents that a request names must be members of the team. StorageActor checks the fields of records
// (model/record_check.h), and LeaseActor checks leases. Thread-safe.
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
inline constexpr double kMapTileMax = 1e10;  // Maximum absolute value of a tile's column and row.

// Returns kRefused, with the start of both team ids, if the request names another team. A request without a team id
// passes. Returns kInvalid if the id is malformed.
Result<void> CheckTeamOf(const proto::ControlRequest& request, const proto::TeamConfig& team);
// Returns kInvalid if the request is for an agent outside the team, and kRefused if that agent has left the team.
Result<void> CheckForAgent(const proto::TeamConfig& team, const proto::ControlRequest& request);

// The following functions check one request each. They return kInvalid with the field, for example
// "insert.records[3].pose_graph_node.node.agent_id".
//
// CheckInsert refuses an insert that
// - has no records or too many;
// - contains a record that only agents may insert (events, roles, optimised poses, verdicts);
// - names an agent outside the team;
// - has a number that no robot measures: a temperature below absolute zero, a quaternion whose length differs from 1 by
//   more than 1 %, or a coordinate beyond 1e9 m.
Result<void> CheckInsert(const proto::TeamConfig& team, const proto::InsertRequest& insert);
// Refuses a read whose filter is too long, whose wait exceeds kReadWaitMax_s, or that combines a wait with
// `is_newest_first` or `is_history`.
Result<void> CheckRead(const proto::ReadRequest& read);
// Refuses a role change that changes nothing, names an agent or a term's issuer outside the team, has a reason that is
// too long, or waits longer than kOrderWaitMax_s.
Result<void> CheckRoleSet(const proto::TeamConfig& team, const proto::RoleSetRequest& set);
// Refuses a share request that has no kind, has `self` as its destination, names agents outside the team, has an order
// number (only agents set it), or waits longer than kOrderWaitMax_s.
Result<void> CheckShare(const proto::TeamConfig& team, AgentId self, const proto::ShareRequest& share);
// Refuses a progress request without a kind or with a wait beyond kReadWaitMax_s.
Result<void> CheckShareProgress(const proto::ShareProgressRequest& progress);
Result<void> CheckRegistration(const proto::RegistrationRequest& registration);
// Refuses a solve with both a window and from_scratch, with too many covariances, or with covariances of agents outside
// the team.
Result<void> CheckOptimize(const proto::TeamConfig& team, const proto::OptimizeRequest& optimize);
// Refuses a merge of agents outside the team.
Result<void> CheckMerge(const proto::TeamConfig& team, const proto::MergeRequest& merge);
// Refuses a position beyond kMapCoordinateMax_m.
Result<void> CheckMapWhy(const proto::MapWhyRequest& why);
// Refuses a region that ends before it begins, a `tiles.after` beyond kMapTileMax, and a wait beyond kMapWaitMax_s.
Result<void> CheckMapTiles(const proto::MapTilesRequest& tiles);
// Refuses a prune with negative limits or too many types, and a prune of fully occluded maps combined with types or
// history.
Result<void> CheckPrune(const proto::PruneOrder& prune);
// Refuses a negative timestamp.
Result<void> CheckAcknowledge(const proto::AcknowledgeRequest& acknowledge);

// Replaces records_max and content_bytes_max by their defaults if they are 0, and limits them to their maxima.
// `is_relayed`: true if the page crosses the radio, which has a smaller maximum of content bytes.
void BoundPage(proto::ReadRequest& request, bool is_relayed = false);

}  // namespace moondb
