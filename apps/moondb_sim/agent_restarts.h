// AgentRestarts: the simulated agents' processes as batteries and service managers see them: power cuts, disks that
// come back broken, restarts; and the checks that nothing failed but what was made to.
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
  // Hears of power cuts from the world's disks from now on.
  AgentRestarts(SimulatedWorld& world, SimulatedRobots& robots);
  ~AgentRestarts();  // All lose power, and nobody hears of it.

  std::function<void(AgentId)> on_end;        // Its process ended.
  std::function<void(AgentId)> on_disk_lost;  // It comes back with an empty, an older or a damaged disk.

  // What moondb_agent does before it makes its actors. False: the power was cut meanwhile.
  bool CheckStore(AgentId agent);

  void Kill(AgentId agent);  // It comes back within two minutes. Nothing if it does not run.
  // Kills an agent with a disk that `fault` (options.cc) broke; one that does not run now, when it comes back.
  void KillWithDisk(AgentId agent, const std::string& fault);
  // Kills an agent that comes back after `down`, and the others know that it is gone before a minute has passed.
  void KillFor(AgentId agent, Duration down);
  bool is_gone(AgentId agent) const { return gone_.contains(agent); }  // As the others know, too.
  void Restart(AgentId agent);  // Now, or when its store opens. Nothing if it runs.

  // An actor of it is about to fail, as is meant.
  void NoteFailure(AgentId agent) { ++failures_[agent]; }
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
  bool was_cut_ = false;                       // The power of some agent, since this was last set to false.
  std::map<AgentId, std::string> disk_fault_;  // At its next restart.
  std::map<AgentId, SimulatedDisk::Image> old_disks_;
  std::set<AgentId> to_restart_;               // They do not run, and will again.
  std::map<AgentId, Duration> down_for_;       // Agents that are killed, and for how long.
  std::set<AgentId> gone_;                     // They do not run, and the others know.
  std::set<AgentId> broken_;                   // Disks that BreakDisk changed, until their store opens.
  std::set<AgentId> damaged_;                  // Disks that were damaged in many places.
  std::map<AgentId, std::uint64_t> failures_;  // Of actors, which were meant to fail; as SimulatedTeam::restarts.
};

}  // namespace moondb::simulation
