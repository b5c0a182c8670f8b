// A small mission of three rovers and a base station with all standard actors, in which faults strike; and what must
// hold of it afterwards.
//
// Robots insert states, nodes, edges and maps at their gateways; an operator collects them at the leader, replicates,
// optimizes, merges, and swaps the roles of leader and survivor half-way. Robots and operator behave as Client's users
// do: who gets no answer in time asks again. Then it is quiet, the operator shares once more, and all is checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/simulation/simulated_team.h"

namespace moondb {

struct Strike {
  std::uint64_t message = 0;  // Which of all that actors handle, from 1.
  simulation::Fault fault = simulation::Fault::kNone;
  bool kills_agent = false;  // The agent's process ends, to start again 3 s later; else the actor alone fails.
};

struct MissionReport {
  std::vector<std::string> handled;  // Each message before it was quiet: "storage insert_request".
  std::vector<std::string> struck;   // Who, at which message, when.
  std::vector<std::string> faults;   // What does not hold; empty: all is well.
  std::size_t kept_count = 0;        // Of RunLosses: records of others that the survivor has.
};

// Runs it to the end, in a folder of its own. Equal arguments give equal runs.
MissionReport RunMission(std::uint64_t seed, const std::vector<Strike>& strikes);

// One mission more: rover 3's link is cut for good as its `batches`-th batch is on its way to the leader, which
// collects; and the leader is lost for good once the survivor has answered as many of what is replicated. The survivor
// takes the lead, solves and merges; what it had acknowledged must be there, and be used.
MissionReport RunLosses(std::uint64_t seed, int batches);

std::string ToString(const Strike& strike);

}  // namespace moondb
