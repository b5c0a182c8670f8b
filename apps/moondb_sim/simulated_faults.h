// SimulatedFaults: what each fault of options.cc does to a simulated team, at random times at its rate.
#pragma once

#include <set>
#include <string>
#include <utility>

#include "apps/moondb_sim/agent_lives.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class SimulatedFaults {
 public:
  SimulatedFaults(SimulatedWorld& world, AgentLives& lives) : world_(world), lives_(lives) {}

  void Start();
  // The world is quiet: the radio is perfect and all links are up; what does not run stays so.
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
  void SetRoles(AgentId agent, proto::RoleSetRequest request);

  SimulatedWorld& world_;
  AgentLives& lives_;
  AgentId fail_next_ = 0;  // An actor of that agent, at its next message.
  std::set<std::pair<AgentId, AgentId>> deaf_;
};

}  // namespace moondb::simulation
