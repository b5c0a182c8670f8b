// SimulatedFaults: injects the faults of FaultKinds() into a simulated team, at random times and at their configured
// rates.
#pragma once

#include <set>
#include <string>
#include <utility>

#include "apps/moondb_sim/agent_restarts.h"
#include "apps/moondb_sim/simulated_robots.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class SimulatedFaults {
 public:
  SimulatedFaults(SimulatedWorld& world, SimulatedRobots& robots, AgentRestarts& restarts)
      : world_(world), robots_(robots), restarts_(restarts) {}

  void Start();
  // Ends all faults of disks, radio and links. Agents that are down stay down, and leases remain valid.
  void End();

  // Call before an actor of `agent` handles a message. Returns how the actor must fail at this message; Fault::kNone if
  // it must not fail.
  Fault AtHandler(AgentId agent);
  // Returns whether messages from `from` to `to` are lost.
  bool IsDeaf(AgentId from, AgentId to) const { return deaf_.contains({from, to}); }

 private:
  void ScheduleFault(const FaultKind& kind);
  void Strike(const std::string& fault);
  void ChangeWeather();
  void RepeatLate();
  void Cut();
  void Deafen();
  void Divide();
  // Brings the link between `a` and `b` up, unless AgentRestarts::is_gone is true for `a` or `b`.
  void Join(AgentId a, AgentId b);
  // Takes the links between `part` and the other agents down, and brings all other links up.
  void JoinParts(const std::set<AgentId>& part);
  void KillInWrite();
  void KillLong();
  void Drive();
  void Sleep();
  void Pause();
  void Prune();
  void FillAndPrune();
  void FillDisk(AgentId agent, Duration length);
  void ChangePolicy();
  void TroubleDisk(bool is_full);  // Makes a random disk full if `is_full`; otherwise makes its writes fail.
  AgentId DrawRover();
  void SetRoles(AgentId agent, proto::RoleSetRequest request);

  SimulatedWorld& world_;
  SimulatedRobots& robots_;
  AgentRestarts& restarts_;
  AgentId fail_next_ = 0;  // Agent whose actor fails at its next message; 0 if none.
  std::set<std::pair<AgentId, AgentId>> deaf_;
};

}  // namespace moondb::simulation
