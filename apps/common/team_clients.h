// Connects operator tools on this machine to the agents of a team file. Not thread-safe.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/client.h"
#include "model/agent_name.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Returns the agent called `name`. If the team has no such agent, returns kInvalid with a text that may suggest a
// similar name.
Result<const proto::AgentConfig*> AgentNamed(const proto::TeamConfig& team, const std::string& name);

// Like AgentNamed, but returns kRefused for an agent that has left the team.
Result<const proto::AgentConfig*> MemberNamed(const proto::TeamConfig& team, const std::string& name);

// Connects a client that knows the team's custom types to `agent`. If `via` is not null, connects to `via` instead,
// which relays the requests to `agent` over the radio. With a secret_key in `options`, connects to the client_address
// in the team file, otherwise to the ipc socket on this machine.
Result<std::unique_ptr<Client>> ConnectTo(const TeamFile& team, const proto::AgentConfig& agent,
                                          Client::Options options, const proto::AgentConfig* via = nullptr);

// Inserts the records in the given order, in batches of at most 512 records and about 2 MB. Calls `inserted` after each
// batch with the number of records inserted so far and the keys of the batch. Stops at the first error.
Result<void> InsertInBatches(Client& client, const std::vector<proto::Record>& records,
                             const std::function<void(std::size_t, const std::vector<RecordKey>&)>& inserted);

}  // namespace moondb
