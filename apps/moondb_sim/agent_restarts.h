// AgentRestarts: cuts the power of simulated agents, breaks their disks and restarts their processes. Also checks that
// no actor fails except by an injected fault.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "apps/moondb_sim/simulated_robots.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class AgentRestarts {
 public:
  // Subscribes to the power cuts of `world.disk` (SimulatedDisk::on_cut).
  AgentRestarts(SimulatedWorld& world, SimulatedRobots& robots);
  ~AgentRestarts();  // Cuts the power of all agents without calling on_end.

  std::function<void(AgentId)> on_end;  // Called when an agent's process has ended.
  // Called when an agent is about to restart with an empty, older or heavily damaged disk.
  std::function<void(AgentId)> on_disk_lost;

  // Opens and closes the agent's store, as moondb_agent does before it creates its actors. Returns false if the store
  // does not open or the power was cut meanwhile.
  bool CheckStore(AgentId agent);

  // Cuts the agent's power. The agent restarts after at most about two minutes. Does nothing if the agent does not run.
  void Kill(AgentId agent);
  // Kills the agent if it runs. Applies the disk fault named `fault` (FaultKinds) before the agent's next restart.
  void KillWithDisk(AgentId agent, const std::string& fault);
  // If the agent runs, kills it, notifies the other agents within 33 s that it is down, and restarts it after `down`.
  void KillFor(AgentId agent, Duration down);
  // Returns whether the agent is down and the other agents were notified that it is down.
  bool is_gone(AgentId agent) const { return gone_.contains(agent); }
  // Restarts the agent as soon as its store opens. Does nothing if the agent runs.
  void Restart(AgentId agent);

  // Call before an injected fault makes an actor of the agent fail. Otherwise CheckFailures reports the failure.
  void ObserveFailure(AgentId agent) { ++failures_[agent]; }
  bool is_damaged(AgentId agent) const { return damaged_.contains(agent); }
  void CheckFailures(AgentId agent);
  void CheckMailboxes(AgentId agent);

 private:
  void OnPowerCut(const std::string& prefix);
  void OnEnded(AgentId agent);
  void NotifyOthers(AgentId agent, bool is_up);
  void BreakDisk(AgentId agent, const std::string& fault);
  void BreakDatabase(AgentId agent, const std::string& fault);
  void MarkBackup(AgentId agent);
  void CheckHave(AgentId agent);

  SimulatedWorld& world_;
  SimulatedRobots& robots_;
  bool was_cut_ = false;                       // True if any agent lost power since CheckStore last cleared this flag.
  std::map<AgentId, std::string> disk_fault_;  // Disk fault to apply at each agent's next restart.
  std::map<AgentId, SimulatedDisk::Image> old_disks_;
  std::set<AgentId> to_restart_;          // Agents that are down and will be restarted.
  std::map<AgentId, Duration> down_for_;  // Time that each agent killed by KillFor stays down.
  std::set<AgentId> gone_;                // Agents whose links NotifyOthers has taken down.
  std::set<AgentId> broken_;              // Agents whose disk BreakDisk changed and whose store has not opened since.
  std::set<AgentId> damaged_;             // Agents whose disk is damaged in many places.
  // Expected value of SimulatedTeam::restarts for each agent. Higher values are failures without an injected fault.
  std::map<AgentId, std::uint64_t> failures_;
};

}  // namespace moondb::simulation
