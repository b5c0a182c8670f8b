// Runs simulated missions with every standard actor. No invariant may be violated, and each rare state that the
// simulator counts (RareStateKinds) must occur.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
#include <string>

#include "apps/moondb_sim/rare_states.h"
#include "apps/moondb_sim/simulated_mission.h"

namespace moondb::simulation {
namespace {

constexpr std::uint64_t kSeeds = 24;

// Returns kSeeds, or a twelfth of MOONDB_SIM_SEEDS (the number of seeds of simulated_mission_test.cc) if it is set.
std::uint64_t SeedCount() {
  const char* text = std::getenv("MOONDB_SIM_SEEDS");
  return text == nullptr ? kSeeds : static_cast<std::uint64_t>(std::max(1, std::atoi(text) / 12));
}

class Quiet : public testing::Environment {
  void SetUp() override { spdlog::set_level(spdlog::level::off); }
};
const auto* const quiet = testing::AddGlobalTestEnvironment(new Quiet);

TEST(AllActorsTest, NoRuleIsBrokenAndEachRareStateIsReached) {
  std::map<std::string, int> reached;
  for (std::uint64_t seed = 1; seed <= SeedCount(); ++seed) {
    SimOptions options;
    options.seed = seed;
    const SimReport report = RunSimulatedMission(options);
    EXPECT_GT(report.records, 100u);
    for (const auto& [state, count] : report.rare) reached[state] += count;
    for (const Violation& violation : report.violations) {
      ADD_FAILURE() << "seed " << seed << " breaks " << violation.rule << " at " << violation.time_s
                    << " s: " << violation.text << "; moondb_sim --seed " << seed << " shows it";
    }
  }
  for (const RareState& state : RareStateKinds()) {
    std::cout << state.name << ": " << reached[state.name] << " times\n";
    if (SeedCount() < kSeeds) continue;
    EXPECT_GT(reached[state.name], 0) << state.what << ": never in " << SeedCount() << " seeds";
  }
  for (const auto& [name, count] : reached) {
    const auto is_it = [name = name](const RareState& state) { return state.name == name; };
    EXPECT_TRUE(std::any_of(RareStateKinds().begin(), RareStateKinds().end(), is_it)) << name << " is not in the list";
  }
}

TEST(AllActorsTest, EqualSeedsGiveEqualRuns) {
  SimOptions options;
  options.seed = 5;
  const SimReport first = RunSimulatedMission(options);
  EXPECT_EQ(first.trace_hash, RunSimulatedMission(options).trace_hash);
}

TEST(AllActorsTest, WithoutFaultsAllIsWell) {
  SimOptions options;
  options.is_faultless = true;
  const SimReport report = RunSimulatedMission(options);
  for (const Violation& violation : report.violations) ADD_FAILURE() << violation.rule << ": " << violation.text;
  EXPECT_TRUE(report.faults.empty());
  EXPECT_GT(report.records, 2000u);
}

}  // namespace
}  // namespace moondb::simulation
