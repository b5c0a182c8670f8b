// TeamReach: connects moonctl to each agent of a team. A direct connection is possible to an agent on this machine and,
// with a key, to an agent with a client_address. Otherwise TeamReach uses a relay: a directly reachable agent that is
// connected to the wanted agent (ControlRequest.for_agent).
//
// The peer status that directly reachable agents report is cached for two seconds. Not thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/client.h"
#include "runtime/team/team_config.h"

namespace moondb {

// A client, and the agent that answers its requests.
struct AgentClient {
  const proto::AgentConfig* agent = nullptr;
  std::unique_ptr<Client> client;
  const proto::AgentConfig* via = nullptr;  // Relays requests over the radio. Null: a direct connection.
};

class TeamReach {
 public:
  struct Options {
    Client::Options client;
    const proto::AgentConfig* via = nullptr;  // Relay for all agents. Null: a relay is chosen for each agent.
    // Called with TeamFile::hash of an answering agent's team file.
    std::function<void(const proto::AgentConfig& agent, std::uint64_t hash)> on_config_hash;
    std::function<void(const proto::AgentConfig& via)> on_relay;  // Called when `via` has relayed a request.
    std::function<void(const std::string& text)> on_remark;       // Called with a warning about this machine.
  };

  // Requires: `team` outlives this object.
  TeamReach(const TeamFile& team, Options options) : team_(team), options_(std::move(options)) {}

  // Connects directly or through a relay. The text of kUnavailable says whether the agent is on this machine and which
  // agent heard it last. Returns kRefused if the agent does not accept this client.
  Result<AgentClient> Connect(const proto::AgentConfig& agent);
  // Connects directly, without a relay. Returns the same errors as Connect.
  Result<AgentClient> ConnectHere(const proto::AgentConfig& agent);

  // Returns the assignment with the newest term among the agents that are directly reachable, or among all agents if
  // Options::via is set. If no agent answers with an assignment, returns the refusal of an agent, or kUnavailable if
  // none refused.
  Result<proto::RoleAssignment> NewestRoles();

  // Returns true if a directly reachable agent is connected to `agent`.
  bool IsHeard(const proto::AgentConfig& agent);

 private:
  // The status of a peer as a directly reachable agent reports it.
  struct Hearing {
    bool is_connected = false;
    double seconds_since_heard = -1;  // Negative: never heard.
  };
  struct Neighbor {
    const proto::AgentConfig* agent = nullptr;
    std::map<AgentId, Hearing> peers;
    bool IsConnectedTo(AgentId peer) const;
  };
  // The reason why a direct connection to an agent failed.
  struct Absence {
    bool is_absent = false;  // No process was found for the agent, so a relay may help.
    bool was_here = false;   // The agent runs or has run on this machine.
    bool runs_here = false;  // The agent runs on this machine, but its socket is missing.
    std::string why;
  };

  Result<AgentClient> ConnectHere(const proto::AgentConfig& agent, Absence* absence);
  Result<AgentClient> Through(const proto::AgentConfig& via, const proto::AgentConfig& agent);
  Client::Options ClientOptionsFor(const proto::AgentConfig& agent) const;
  const std::vector<Neighbor>& Neighbors();
  // Returns a relay that is connected to `agent`. Null: there is none.
  const proto::AgentConfig* ChooseVia(const proto::AgentConfig& agent);
  // Returns text such as "agent rover1 is not on this machine, rover2 heard it 0.2 s ago".
  std::string WhereText(const proto::AgentConfig& agent, const Absence& absence);

  const TeamFile& team_;
  const Options options_;
  std::vector<Neighbor> neighbors_;
  std::chrono::steady_clock::time_point neighbors_at_{};
  const proto::AgentConfig* last_via_ = nullptr;
};

}  // namespace moondb
