// LinkedAgents: several agents of one team in this process, joined by ZeroMqTransport over loopback TCP.
#pragma once

#include <condition_variable>
#include <latch>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bench/tally.h"
#include "runtime/actor_system.h"
#include "runtime/team/team_config.h"
#include "runtime/transport/zeromq_transport.h"
#include "tests/temporary_folder.h"

namespace moondb {

class LinkedAgents {
 public:
  // Creates the agents 1 to `agent_count`. With `is_curve`, each agent has its own CURVE keys; otherwise the team is
  // insecure. If a mailbox refuses a message, `tally` fails. `tally` must outlive this object.
  LinkedAgents(int agent_count, bool is_curve, Tally& tally);
  ~LinkedAgents();

  // Returns the agent's actor system. Spawn actors in it before Start.
  ActorSystem& system(AgentId agent) { return *agents_.at(agent - 1)->system; }
  // Returns the agent's transport. Requires: Start was called.
  Transport& transport(AgentId agent) { return *agents_.at(agent - 1)->transport; }

  // Starts all agents and waits until they are connected to each other. Errors: those of ZeroMqTransport::Create;
  // kUnavailable if not all are connected within a minute.
  Result<void> Start();

 private:
  struct Agent {
    std::latch is_up{1};  // Counted down when `transport` is set. Callbacks wait until then.
    std::unique_ptr<ActorSystem> system;
    std::unique_ptr<ZeroMqTransport> transport;
  };

  Result<void> WriteTeamFile();
  Result<void> StartAgent(AgentId id);

  const bool is_curve_;
  Tally& tally_;
  const TemporaryFolder folder_;
  TeamFile team_;
  std::vector<std::unique_ptr<Agent>> agents_;

  std::mutex mutex_;
  std::condition_variable changed_;
  int connections_ = 0;  // Number of connected peers, summed over all agents.
};

}  // namespace moondb
