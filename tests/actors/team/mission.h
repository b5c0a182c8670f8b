// A small mission of three rovers and a base station with all standard actors, in which faults strike, and the
// invariants that must hold afterwards.
//
// Robots insert states, nodes, edges and maps at their gateways. An operator collects them at the leader, replicates,
// optimizes and merges, and swaps the roles of leader and survivor half-way. Robots and operator repeat requests that
// get no answer in time, as users of Client do. Then the faults stop, the operator shares once more, and everything is
// checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/simulation/simulated_team.h"

namespace moondb {

struct Strike {
  std::uint64_t message = 0;  // Number of the message, from 1, among all messages that actors handle.
  simulation::Fault fault = simulation::Fault::kNone;
  bool kills_agent = false;  // Ends the agent's process, which restarts 3 s later. Otherwise only the actor fails.
};

struct MissionReport {
  std::vector<std::string> handled;  // Each message before the faults stopped, for example "storage insert_request".
  std::vector<std::string> struck;   // For each strike, the actor, the message and the time.
  std::vector<std::string> faults;   // Violated invariants. Empty if all hold.
  std::size_t kept_count = 0;        // For RunLosses: number of other agents' records that the survivor holds.
};

// Runs a mission to its end in a temporary folder. Equal arguments give equal runs.
MissionReport RunMission(std::uint64_t seed, const std::vector<Strike>& strikes);

// Runs a mission in which rover 3's link is cut permanently once its `batches`-th batch is in flight to the collecting
// leader. The leader is lost permanently once the survivor has acknowledged `batches` replicated batches. Then the
// survivor takes the lead, solves and merges. It must hold and use all records that it acknowledged.
MissionReport RunLosses(std::uint64_t seed, int batches);

std::string ToString(const Strike& strike);

}  // namespace moondb
