// Which configured starts say where a rover begins. Thread-safe.
//
// Two rovers cannot stand in one place. Starts within one footprint of each other are therefore a template that nobody
// filled in, or a dock from which rovers leave one after another. Only the start of the lowest id counts.
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "model/geometry.h"
#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the pose of a start in the frame `map`.
Pose PoseOf(const proto::StartPose& start);

// Returns the rovers whose starts count. Requires: `team` is complete and validated.
std::set<AgentId> KnownStarts(const proto::TeamConfig& team);

// Returns the rovers whose starts do not count, each with the rover whose start lies within one footprint (the larger
// side of map.footprint_m).
std::vector<std::pair<AgentId, AgentId>> CoincidingStarts(const proto::TeamConfig& team);

}  // namespace moondb
