#include "runtime/transport/listener_limits.h"

#include <optional>
#include <string>

#include "model/control_request.h"
#include "model/team_member.h"
#include "runtime/transport/client_listener.h"
#include "runtime/transport/listen_address.h"

namespace moondb {
namespace {

// Limit of connections per agent: the current connection, its replacement, and two more for a reconnect.
constexpr std::size_t kConnectionsPerAgent = 4;
constexpr std::size_t kStrangersMax = 32;     // Limit of connections to the agent's peer address from outside the team.
constexpr std::size_t kKeyedClientsMax = 64;  // Limit of connections to client_address.

}  // namespace

std::map<std::uint16_t, ConnectionRules::Listener> ListenerLimits(const proto::TeamConfig& team,
                                                                  const proto::AgentConfig& self) {
  std::map<std::uint16_t, ConnectionRules::Listener> listeners;
  if (const std::optional<std::uint16_t> port = TcpPortOf(ListenAddressOf(self))) {
    ConnectionRules::Listener& listener = listeners[*port];
    listener.others_max = kStrangersMax;
    listener.key_max = kConnectionsPerAgent;
    listener.shared_bytes = kAgentsSharedBytes;
    for (const proto::AgentConfig& agent : team.agents()) {
      if (agent.left()) continue;
      // Connections of an agent behind NAT may come from any address.
      const std::string address = agent.listen().empty() ? NumericAddressOf(agent.address()) : "";
      (address.empty() ? listener.others_max : listener.places[address]) += kConnectionsPerAgent;
    }
  }
  if (const std::optional<std::uint16_t> port = TcpPortOf(self.client_address())) {
    listeners[*port] = {.places = {},
                        .others_max = kKeyedClientsMax,
                        .key_max = ClientListener::kConnectionsOfKeyMax,
                        .shared_bytes = kKeyedRequestBytesMax};
  }
  return listeners;
}

}  // namespace moondb
