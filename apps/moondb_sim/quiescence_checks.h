// QuiescenceChecks: what must hold of a simulated team when faults have ended and all that was to be shared is: the
// rules at rest (rules.h), and those of the sessions, histories and roles of its agents.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "apps/moondb_sim/agent_restarts.h"
#include "apps/moondb_sim/byzantine_checker.h"
#include "apps/moondb_sim/prune_checker.h"
#include "apps/moondb_sim/simulated_clients.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class QuiescenceChecks {
 public:
  QuiescenceChecks(SimulatedWorld& world, AgentRestarts& restarts, SimulatedClients& clients,
                   const ByzantineChecker& byzantine, const std::map<AgentId, PruneChecker>& prunes)
      : world_(world), restarts_(restarts), clients_(clients), byzantine_(byzantine), prunes_(prunes) {}

  // Advances time by some minutes, in which nothing may go on.
  void Check();

 private:
  // What all honest agents have, from their role actors and as their other actors heard it; nothing if a rule is
  // broken.
  std::optional<proto::RoleAssignment> CheckRoles();
  void CheckHistory(AgentId agent, const HaveSet& have);
  void CheckBytesEnd();
  void CheckSessions(AgentId agent);
  // Of sessions that bring the leader states unasked, and find nothing new.
  std::uint64_t StatesBytesMax(Duration length) const;
  // The survivor's questions to the leader, with the answers (FailoverActor).
  std::uint64_t LeaderCheckBytesMax(Duration length) const;

  SimulatedWorld& world_;
  AgentRestarts& restarts_;
  SimulatedClients& clients_;
  const ByzantineChecker& byzantine_;
  const std::map<AgentId, PruneChecker>& prunes_;
};

}  // namespace moondb::simulation
