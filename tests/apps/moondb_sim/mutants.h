// Mutants: actors of sharing with one rule broken on purpose, each a wrapper around the real actor, so that no program
// holds the means to break it. The simulator must notice.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/moondb_sim/options.h"

namespace moondb::simulation {

struct Mutant {
  std::string name;
  std::string what;
  // For one run: what it keeps beyond its actors' lives begins anew.
  std::function<decltype(SimOptions::wrap)()> make;
};

const std::vector<Mutant>& Mutants();

}  // namespace moondb::simulation
