// Address: names an actor of an agent, for example as the destination of a message.
#pragma once

#include <compare>
#include <string>

#include "model/ids.h"

namespace moondb {

// Aliases of agents. An alias is resolved when a message is sent, so an address with an alias stays valid when roles
// change. The values are above kAgentIdMax.
inline constexpr AgentId kLeaderAlias = 0xFFFF'0001;    // @leader
inline constexpr AgentId kSurvivorAlias = 0xFFFF'0002;  // @survivor
inline constexpr AgentId kBaseAlias = 0xFFFF'0003;      // @base, the base station
// Stands for all clients of this agent (moonctl, a robot's software). In a client's address, `actor` is the name that
// the transport assigned to the client's connection.
inline constexpr AgentId kClients = 0xFFFF'0010;

struct Address {
  AgentId agent = 0;
  std::string actor;
  auto operator<=>(const Address&) const = default;
};

// Returns for example "2/storage" or "@leader/sync".
std::string ToString(const Address& address);

// Names of the actors that every agent runs.
namespace actor_name {
inline constexpr char kStorage[] = "storage";
inline constexpr char kSync[] = "sync";
inline constexpr char kReplica[] = "replica";
inline constexpr char kPgo[] = "pgo";
inline constexpr char kRegister[] = "register";
inline constexpr char kMerge[] = "merge";
inline constexpr char kRole[] = "role";
inline constexpr char kFailover[] = "failover";
inline constexpr char kLease[] = "lease";
inline constexpr char kGateway[] = "gateway";
inline constexpr char kClock[] = "clock";
inline constexpr char kEvent[] = "event";
inline constexpr char kDownlink[] = "downlink";
inline constexpr char kRetention[] = "retention";
}  // namespace actor_name

}  // namespace moondb
