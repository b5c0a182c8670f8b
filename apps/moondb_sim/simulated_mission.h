// A whole team for some hours of simulated time: real actors on real SQLite, over a simulated radio and disks, with
// robots that insert, an operator that shares and assigns roles, and faults; then quiet, and a check of all the rules.
//
// One thread. Equal options give equal runs, which trace_hash shows.
#pragma once

#include "apps/moondb_sim/options.h"
#include "apps/moondb_sim/sim_report.h"

namespace moondb::simulation {

SimReport RunSimulatedMission(const SimOptions& options);

}  // namespace moondb::simulation
