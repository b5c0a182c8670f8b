// QuiescenceChecks: checks a simulated team when faults have ended and sharing should be complete. Covers the
// invariants of a quiescent team (invariants.h), including its sessions, histories and roles.
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

  // Runs all checks. Advances the simulated time by 11 minutes. In the last 10 minutes, the team may send only periodic
  // messages.
  void Check();

 private:
  // Returns the role assignment that all actors of all honest agents know. Reports a violation and returns null if an
  // agent does not run, or if two assignments differ.
  std::optional<proto::RoleAssignment> CheckRoles();
  void CheckHistory(AgentId agent, const HaveSet& have);
  void CheckBytesEnd();
  void CheckSessions(AgentId agent);
  // Returns the most bytes that periodic sessions of all agents may send within `length` when there are no new states.
  // Bytes of have-sets that agents compare in this time because records flow (radio.sync_period_s).
  std::uint64_t FlowBytesMax(Duration length) const;
  std::uint64_t StatesBytesMax(Duration length) const;
  // Returns the most bytes that the survivor's checks of the leader (FailoverActor), with their answers, may take
  // within `length`.
  std::uint64_t LeaderCheckBytesMax(Duration length) const;

  SimulatedWorld& world_;
  AgentRestarts& restarts_;
  SimulatedClients& clients_;
  const ByzantineChecker& byzantine_;
  const std::map<AgentId, PruneChecker>& prunes_;
};

}  // namespace moondb::simulation
