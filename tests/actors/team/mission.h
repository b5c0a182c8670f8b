// Simulates a small mission of three rovers and a base station with all standard actors, strikes it with faults, and
// then checks invariants.
//
// Robots insert records at their agents. An operator syncs, replicates, optimizes and merges at the leader, and swaps
// the roles of leader and survivor half-way. Robots and operator repeat requests that get no answer in time. When the
// faults have stopped, the operator shares once more, and all invariants are checked.
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
  std::vector<std::string> faults;   // Descriptions of violated invariants. Empty if all hold.
  std::size_t kept_count = 0;        // For RunLosses: number of other agents' records that the survivor holds.
};

// Runs a mission to its end in a temporary folder. Equal arguments give equal runs.
MissionReport RunMission(std::uint64_t seed, const std::vector<Strike>& strikes);

// Runs a mission that loses two agents permanently. Rover 3 is cut off when its `batches`-th batch of the sync is in
// flight to the leader, agent 1. Agent 1 is lost when the survivor, agent 2, has acknowledged `batches` batches of the
// replication. Then the survivor takes the lead, solves and merges. The survivor must hold and use all records that it
// acknowledged.
MissionReport RunLosses(std::uint64_t seed, int batches);

std::string ToString(const Strike& strike);

}  // namespace moondb
