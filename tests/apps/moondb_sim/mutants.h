// Mutants: actors with one rule broken on purpose, nearly each a wrapper around the real actor, so that no
// program holds the means to break it. The simulator must notice, by a rule that speaks of what was broken.
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
  std::vector<std::string> invariants;  // Whichever is broken first is one of these.
  std::uint64_t seeds = 0;              // The rule is broken in one of the seeds 1 to this.
  // For one run: what it keeps beyond its actors' lives begins anew.
  std::function<void(SimOptions& options)> apply;
  SimulatedActors actors = SimulatedActors::kSharing;
  bool is_of_lies = false;        // Only seeds with a Byzantine agent notice. Other mutants run without one.
  std::uint64_t likely_seed = 1;  // Tried first, to save time.
};

const std::vector<Mutant>& Mutants();

// For gtest.
inline void PrintTo(const Mutant& mutant, std::ostream* out) { *out << mutant.what; }

}  // namespace moondb::simulation
