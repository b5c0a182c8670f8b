// Limits of the connections to an agent's listening addresses.
#pragma once

#include <cstdint>
#include <map>

#include "proto/team.pb.h"
#include "runtime/transport/connection_rules.h"

namespace moondb {

// Value of ConnectionRules::Listener::shared_bytes for the connections of agents. Covers the largest credit of a link
// that this agent reads slowly.
inline constexpr std::uint64_t kAgentsSharedBytes = 1024 * 1024;

// Returns the connection limits of each port on which `self` listens. For an agent whose address is a host name or not
// its own, raises the common limit of all addresses that have no own limit (ConnectionRules::Listener::others_max).
std::map<std::uint16_t, ConnectionRules::Listener> ListenerLimits(const proto::TeamConfig& team,
                                                                  const proto::AgentConfig& self);

}  // namespace moondb
