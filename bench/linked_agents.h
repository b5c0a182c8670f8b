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
  // With ids from 1. `is_curve`: with keys of their own, else insecure. A message that an actor has no room for makes
  // `tally` fail; it outlives this.
  LinkedAgents(int agent_count, bool is_curve, Tally& tally);
  ~LinkedAgents();

  // To spawn actors in, before Start.
  ActorSystem& system(AgentId agent) { return *agents_.at(agent - 1)->system; }
  // From Start on.
  Transport& transport(AgentId agent) { return *agents_.at(agent - 1)->transport; }

  // Until each agent has reached every other. Errors: what ZeroMqTransport::Create says; kUnavailable when they do not
  // reach each other within a minute.
  Result<void> Start();

 private:
  struct Agent {
    std::latch is_up{1};  // Before it the transport has nobody to notify.
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
  int connections_ = 0;  // Reached peers of all agents together.
};

}  // namespace moondb
