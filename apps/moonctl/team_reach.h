// TeamReach: how moonctl reaches each agent of a team: itself where it lets clients in (on this machine, or with a key
// at its client_address), else through an agent that does and is connected to it (ControlRequest.for_agent).
//
// What the agents that are reached themselves say of the others is asked again after two seconds. One thread.
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

// A client and whose it is.
struct AgentClient {
  const proto::AgentConfig* agent = nullptr;
  std::unique_ptr<Client> client;
  const proto::AgentConfig* via = nullptr;  // Asks `agent` over the radio; null: it is asked itself.
};

class TeamReach {
 public:
  struct Options {
    Client::Options client;
    const proto::AgentConfig* via = nullptr;  // Everybody is asked through this one; null: as above.
    // TeamFile::hash of the file of an agent that answered.
    std::function<void(const proto::AgentConfig& agent, std::uint64_t hash)> on_config_hash;
    std::function<void(const proto::AgentConfig& via)> on_relay;  // Somebody was reached through this one.
    std::function<void(const std::string& text)> on_remark;       // What a person should know of this machine.
  };

  // `team` outlives this.
  TeamReach(const TeamFile& team, Options options) : team_(team), options_(std::move(options)) {}

  // kUnavailable with whether the agent is on this machine, and who heard it last; kRefused where it does not let this
  // client in.
  Result<AgentClient> Connect(const proto::AgentConfig& agent);
  // The same, of an agent that is reached itself.
  Result<AgentClient> ConnectHere(const proto::AgentConfig& agent);

  // The assignment with the newest term that is known to the agents that are reached themselves, or with Options::via
  // to all. kUnavailable if none answers.
  Result<proto::RoleAssignment> NewestRoles();

  // An agent that is reached itself is connected to this one.
  bool IsHeard(const proto::AgentConfig& agent);

 private:
  // What an agent that is reached itself says of another one.
  struct Hearing {
    bool is_connected = false;
    double seconds_since_heard = -1;  // Negative: never.
  };
  struct Neighbor {
    const proto::AgentConfig* agent = nullptr;
    std::map<AgentId, Hearing> peers;
    bool IsConnectedTo(AgentId peer) const;
  };
  // Why an agent is not reached itself.
  struct Absence {
    bool is_absent = false;  // Nobody listens for it; else somebody does, and does not answer.
    bool was_here = false;   // It runs or has run on this machine.
    bool runs_here = false;  // Without its socket.
    std::string why;
  };

  Result<AgentClient> ConnectHere(const proto::AgentConfig& agent, Absence* absence);
  Result<AgentClient> Through(const proto::AgentConfig& via, const proto::AgentConfig& agent);
  Client::Options ClientOptionsFor(const proto::AgentConfig& agent) const;
  const std::vector<Neighbor>& Neighbors();
  // Null where none is connected to it.
  const proto::AgentConfig* ChooseVia(const proto::AgentConfig& agent);
  // "agent rover1 is not on this machine, rover2 heard it 0.2 s ago".
  std::string WhereText(const proto::AgentConfig& agent, const Absence& absence);

  const TeamFile& team_;
  const Options options_;
  std::vector<Neighbor> neighbors_;
  std::chrono::steady_clock::time_point neighbors_at_{};
  const proto::AgentConfig* last_via_ = nullptr;
};

}  // namespace moondb
