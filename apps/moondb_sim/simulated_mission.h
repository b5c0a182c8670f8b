// Simulates a whole team for some hours of simulated time: real actors on real SQLite, over a simulated radio and
// simulated disks. Robots insert records, an operator shares and assigns roles, and faults strike. At the end the
// faults stop, and all invariants are checked.
//
// Single-threaded. Equal options give equal runs, which trace_hash shows.
#pragma once

#include "apps/moondb_sim/options.h"
#include "apps/moondb_sim/sim_report.h"

namespace moondb::simulation {

SimReport RunSimulatedMission(const SimOptions& options);

}  // namespace moondb::simulation
