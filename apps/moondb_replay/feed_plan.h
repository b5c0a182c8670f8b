// Computes the records that each robot of a mission would have inserted at its agent, in order of timestamps.
//
// Nodes have raw poses, never the true ones. Each range belongs to the agent of its RangeEdge::from. PlanFeed reads the
// images of the maps from the mission's folder.
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "model/error.h"
#include "model/mission.h"
#include "proto/record.pb.h"

namespace moondb {

// Half-open interval of mission time: includes from_ns, excludes to_ns.
struct TimeSpan {
  std::int64_t from_ns = 0;
  std::int64_t to_ns = 0;
  bool Contains(std::int64_t timestamp_ns) const { return timestamp_ns >= from_ns && timestamp_ns < to_ns; }
};

// A mission whose times count from its start has no dates, and agents do not trust timestamps before kTimestampMin_ns.
// The feed moves such a mission to 2026-01-01.
inline constexpr std::int64_t kFeedStart_ns = 1'767'225'600'000'000'000;  // 2026-01-01.

// Returns the agent's own records within `span` of mission time: two initial states (the agent is awake, and its
// activity is exploring, or idle for a base station), nodes, odometry, ranges and maps. At equal timestamps the node
// comes first and the map last. Errors are those of ReadMissionMap.
Result<std::vector<proto::Record>> PlanFeed(const Mission& mission, AgentId agent, const TimeSpan& span);

// Returns a key that identifies a record within a feed: the type, the timestamp and the natural key. A repeated feed
// uses the key to skip records that the agent already holds.
std::string FeedKey(const proto::Record& record);

}  // namespace moondb
