// `moonctl db holdings --maps`: which agent holds whose local maps.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "apps/moonctl/exit_code.h"
#include "model/have_set.h"
#include "model/ids.h"
#include "proto/role.pb.h"
#include "proto/team.pb.h"

namespace moondb {

class CommandContext;

// Local maps of one origin at one agent.
struct MapHolding {
  AgentId origin = 0;
  std::uint64_t held = 0;
  std::uint64_t lacking = 0;  // Maps that the leader holds and this agent does not cover.
  // True: roles or policies of the team file bring these maps to the agent, so it should lack none.
  bool is_meant = false;
};

// Returns whether the policies `rovers` or `ground` of the team file bring all local maps to the agent.
bool GetsAllMaps(const proto::TeamConfig& team, AgentId agent);

// Returns the holdings of the agent, of each origin of which the leader or the agent holds a map.
std::vector<MapHolding> MapHoldingsOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent,
                                      const HaveSet& have, const HaveSet& leaders);

// Returns kFailed if an agent lacks maps that it should have.
ExitCode ShowMapHoldings(CommandContext& context);

}  // namespace moondb
