// The agents of a team file, as an operator's tool reaches them from this machine. Not thread-safe.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/client.h"
#include "model/agent_name.h"
#include "runtime/team/team_config.h"

namespace moondb {

// kInvalid with a suggestion where the team has no agent of that name.
Result<const proto::AgentConfig*> AgentNamed(const proto::TeamConfig& team, const std::string& name);

// The same, and kRefused for one that has left the team.
Result<const proto::AgentConfig*> MemberNamed(const proto::TeamConfig& team, const std::string& name);

// The client knows the team's custom types. With a secret_key in the options it goes to the agent's client_address,
// else to its ipc socket on this machine. `via`: the agent that is connected to and asks `agent` over the radio; null:
// `agent` itself.
Result<std::unique_ptr<Client>> ConnectTo(const TeamFile& team, const proto::AgentConfig& agent,
                                          Client::Options options, const proto::AgentConfig* via = nullptr);

// Inserts in the given order, in batches of at most 512 records and about 2 MB; `inserted` is called after each batch
// with the count so far. Stops at the first error.
Result<void> InsertInBatches(Client& client, const std::vector<proto::Record>& records,
                             const std::function<void(std::size_t)>& inserted);

}  // namespace moondb
