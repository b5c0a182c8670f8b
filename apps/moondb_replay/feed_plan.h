// What each robot of a mission would have inserted at its agent, in order of stamps.
//
// Nodes carry raw poses, ranges go to the agent of their first end, maps are packed as robots pack them. The truth is
// never part of it. Plain functions; maps' pictures are read here, from the mission's folder.
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "model/error.h"
#include "model/mission.h"
#include "proto/record.pb.h"

namespace moondb {

// Half-open, in nanoseconds of mission time.
struct TimeSpan {
  std::int64_t from_ns = 0;
  std::int64_t to_ns = 0;
  bool Contains(std::int64_t timestamp_ns) const { return timestamp_ns >= from_ns && timestamp_ns < to_ns; }
};

// The agent's own records within `span`: its state at the beginning (awake, exploring), nodes, odometry, ranges, maps.
// Of equal stamps the node comes first and the map last. Errors as ReadMissionMap.
Result<std::vector<proto::Record>> PlanFeed(const Mission& mission, AgentId agent, const TimeSpan& span);

// Tells records of one feed apart, so that feeding twice stores nothing twice: the type, the stamp and the natural key.
std::string FeedKey(const proto::Record& record);

}  // namespace moondb
