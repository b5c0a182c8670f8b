// Mutants: actors that each violate one invariant, to test whether the simulator reports it. Nearly all mutants wrap
// the real actor, so production code contains no faults for tests.
#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "apps/moondb_sim/options.h"

namespace moondb::simulation {

struct Mutant {
  std::string name;
  std::string what;
  std::vector<std::string> invariants;  // The first reported violation must be of one of these invariants.
  std::uint64_t seeds = 0;              // At least one seed from 1 to `seeds` must cause a violation.
  // Installs the mutant for one run. Makes new shared state, which survives restarts of actors but is not shared with
  // other runs.
  std::function<void(SimOptions& options)> apply;
  SimulatedActors actors = SimulatedActors::kSharing;
  bool is_of_lies = false;        // Runs with a Byzantine agent; other mutants run without one.
  std::uint64_t likely_seed = 1;  // The seed that is tried first, to save time.
};

const std::vector<Mutant>& Mutants();

// Prints the parameter in gtest's messages.
inline void PrintTo(const Mutant& mutant, std::ostream* out) { *out << mutant.what; }

}  // namespace moondb::simulation
