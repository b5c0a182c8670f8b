// Mutants: actors that break one rule on purpose, to test whether the simulator reports it. Nearly all wrap the real
// actor, so production programs contain no code that breaks rules. The reported violation must be of a rule about the
// broken behaviour.
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
  std::vector<std::string> invariants;  // The first reported violation is of one of these rules.
  std::uint64_t seeds = 0;              // At least one of the seeds from 1 to `seeds` breaks the rule.
  // Installs the mutant for one run. Creates state that outlives the run's actors, so that runs do not share it.
  std::function<void(SimOptions& options)> apply;
  SimulatedActors actors = SimulatedActors::kSharing;
  bool is_of_lies = false;        // Runs with a Byzantine agent; other mutants run without one.
  std::uint64_t likely_seed = 1;  // The seed that is tried first, to save time.
};

const std::vector<Mutant>& Mutants();

// Prints the parameter in gtest's messages.
inline void PrintTo(const Mutant& mutant, std::ostream* out) { *out << mutant.what; }

}  // namespace moondb::simulation
