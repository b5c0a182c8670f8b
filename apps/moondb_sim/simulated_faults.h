// SimulatedFaults: what each fault of options.cc does to a simulated team, at random times at its rate.
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
  // The world is quiet: the radio is perfect and all links are up; what does not run stays so, and so do leases.
  void End();

  // How an actor of `agent` fails at the message that it is about to handle.
  Fault AtHandler(AgentId agent);
  // What `from` sends, `to` does not hear.
  bool IsDeaf(AgentId from, AgentId to) const { return deaf_.contains({from, to}); }

 private:
  void ScheduleFault(const FaultKind& kind);
  void Strike(const std::string& fault);
  void ChangeWeather();
  void RepeatLate();
  void Cut();
  void Deafen();
  void Divide();
  // Links of agents that are known to be gone stay down.
  void Join(AgentId a, AgentId b);
  void JoinParts(const std::set<AgentId>& part);  // But for the links between it and the rest.
  void KillInWrite();
  void KillLong();
  void Drive();
  void Sleep();
  void Pause();
  void Prune();
  void FillAndPrune();
  void FillDisk(AgentId agent, Duration length);
  void ChangePolicy();
  void TroubleDisk(bool is_full);  // Else it fails.
  AgentId DrawRover();
  void SetRoles(AgentId agent, proto::RoleSetRequest request);

  SimulatedWorld& world_;
  SimulatedRobots& robots_;
  AgentRestarts& restarts_;
  AgentId fail_next_ = 0;  // An actor of that agent, at its next message.
  std::set<std::pair<AgentId, AgentId>> deaf_;
};

}  // namespace moondb::simulation
