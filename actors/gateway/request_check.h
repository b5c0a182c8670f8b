// The door for clients: what a ControlRequest may hold before any actor sees it.
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

// `self` is the agent that is asked.
//
// kInvalid, with the field named as in "insert.records[3].pose_graph_node.node.agent_id": no request set, an agent
// that is not of the team, an insert without records or with too many, a share without a kind or to `self`, a role
// change that changes nothing or a reason that is too long, filters that are too long, a window that is to begin from
// scratch, too many covariances, too many types to prune, any of them or history beside beaten maps, limits of a prune
// that are negative, a place beyond kMapCoordinateMax_m, a region that ends before it begins, a wait beyond
// kMapWaitMax_s or kReadWaitMax_s, a wait for older records or for history, an acknowledgment without a stamp.
Result<void> CheckRequest(const proto::TeamConfig& team, AgentId self, const proto::ControlRequest& request);

// Brings the limits of a page into 1 to the maximum; 0 becomes the default. `is_relayed`: the page crosses the radio.
void BoundPage(proto::ReadRequest& request, bool is_relayed = false);

}  // namespace moondb
