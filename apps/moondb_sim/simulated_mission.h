// Simulates a whole team for some hours of simulated time: real actors on real SQLite, over a simulated radio and
// simulated disks. Robots insert records, an operator orders sharing and assigns roles, and faults are injected. At the
// end the faults stop, and all invariants are checked.
//
// Single-threaded. Runs with equal options are equal, and have the same SimReport::trace_hash.
#pragma once

#include "apps/moondb_sim/options.h"
#include "apps/moondb_sim/sim_report.h"

namespace moondb::simulation {

SimReport RunSimulatedMission(const SimOptions& options);

}  // namespace moondb::simulation
