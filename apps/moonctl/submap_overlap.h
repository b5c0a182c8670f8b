// Reads the submaps of two rovers that the search for starts laid over each other, for `moonctl map overlap`.
#pragma once

#include "actors/registration/submap.h"
#include "apps/moonctl/command_context.h"
#include "apps/moonctl/map_overlap.h"

namespace moondb {

// Reads the pair of submaps with the most evidence. Returns kNotFound if the leader has not searched for the relative
// pose of these rovers, or if no two of their submaps fit, and any error of the agent.
Result<Overlap> ReadSubmaps(AgentClient& target, const proto::TeamConfig& team, AgentId first, AgentId second);

// Returns the cells of a submap as a map with one layer of 10 cm.
TraversabilityMap CellsOf(const Submap& submap);

}  // namespace moondb
