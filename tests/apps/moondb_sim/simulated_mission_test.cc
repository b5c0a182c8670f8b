// Runs simulated missions with all faults. Without a mutant, no invariant may be violated. With a mutant, the simulator
// must report a violation.
#include "apps/moondb_sim/simulated_mission.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <iostream>

#include "tests/apps/moondb_sim/mutants.h"

namespace moondb::simulation {
namespace {

constexpr std::uint64_t kShards = 10;

// Returns the number of seeds of all shards together: MOONDB_SIM_SEEDS if set, otherwise 280.
std::uint64_t SeedCount() {
  const char* text = std::getenv("MOONDB_SIM_SEEDS");
  return text == nullptr ? 280 : static_cast<std::uint64_t>(std::max(1, std::atoi(text)));
}

class Quiet : public testing::Environment {
  void SetUp() override { spdlog::set_level(spdlog::level::off); }
};
const auto* const quiet = testing::AddGlobalTestEnvironment(new Quiet);

void PrintTo(const SimReport& report, std::ostream& out) {
  for (const std::string& event : report.last_events) out << event << "\n";
  for (const Violation& violation : report.violations) {
    out << violation.rule << " at " << violation.time_s << " s: " << violation.text << "\n";
  }
}

class SweepTest : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SweepTest, NoRuleIsBroken) {
  for (std::uint64_t seed = 1 + GetParam(); seed <= SeedCount(); seed += kShards) {
    SimOptions options;
    options.actors = SimulatedActors::kSharing;
    options.seed = seed;
    const SimReport report = RunSimulatedMission(options);
    EXPECT_GT(report.records, 100u);
    if (report.violations.empty()) continue;
    PrintTo(report, std::cout);
    FAIL() << "seed " << seed << " breaks " << report.violations.front().rule << "; moondb_sim --seed " << seed
           << " shows it";
  }
}

INSTANTIATE_TEST_SUITE_P(Shards, SweepTest, testing::Range(std::uint64_t{0}, kShards));

TEST(SimulatedMissionTest, EqualSeedsGiveEqualRuns) {
  SimOptions options;
  options.actors = SimulatedActors::kSharing;
  options.seed = 5;
  const SimReport first = RunSimulatedMission(options);
  const SimReport again = RunSimulatedMission(options);
  EXPECT_EQ(first.trace_hash, again.trace_hash);
  EXPECT_EQ(first.messages, again.messages);
  EXPECT_FALSE(first.faults.empty());
  options.seed = 6;
  EXPECT_NE(RunSimulatedMission(options).trace_hash, first.trace_hash);
}

TEST(SimulatedMissionTest, WithoutFaultsAllIsWell) {
  SimOptions options;
  options.actors = SimulatedActors::kSharing;
  options.is_faultless = true;
  const SimReport report = RunSimulatedMission(options);
  PrintTo(report, std::cout);
  EXPECT_TRUE(report.violations.empty());
  EXPECT_TRUE(report.faults.empty());
  EXPECT_GT(report.records, 4000u);
}

TEST(SimulatedMissionTest, SurvivorsTakeTheLeadInOneSeedOfThree) {
  int failovers = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    SimOptions options;
    options.actors = SimulatedActors::kSharing;
    options.seed = seed;
    options.faults_per_hour["long_kill"] = 6;
    const SimReport report = RunSimulatedMission(options);
    PrintTo(report, std::cout);
    EXPECT_TRUE(report.violations.empty());
    if (seed % 3 == 0) {
      failovers += report.failovers;
    } else {
      EXPECT_EQ(report.failovers, 0);
    }
  }
  EXPECT_GT(failovers, 0);
}

TEST(SimulatedMissionTest, KeepsAllRulesInSeedsThatBrokeOne) {
  struct Seed {
    std::uint64_t number;
    SimulatedActors actors;
    double hours;
  };
  for (const auto& [number, actors, hours] :
       {Seed{1779860680, SimulatedActors::kAll, 1}, Seed{2094544, SimulatedActors::kAll, 1},
        Seed{1582404, SimulatedActors::kSharing, 2}, Seed{498, SimulatedActors::kSharing, 2}}) {
    SimOptions options;
    options.seed = number;
    options.actors = actors;
    options.hours = hours;
    options.has_flow = false;  // These seeds broke a rule before records flowed.
    const SimReport report = RunSimulatedMission(options);
    PrintTo(report, std::cout);
    EXPECT_TRUE(report.violations.empty()) << "seed " << number;
  }
}

class MutantTest : public testing::TestWithParam<Mutant> {};

TEST_P(MutantTest, IsCaughtByItsRule) {
  const Mutant& mutant = GetParam();
  ASSERT_LE(mutant.likely_seed, mutant.seeds);
  std::vector<std::uint64_t> seeds{mutant.likely_seed};
  for (std::uint64_t seed = 1; seed <= mutant.seeds; ++seed) {
    if (seed != mutant.likely_seed) seeds.push_back(seed);
  }
  for (const std::uint64_t seed : seeds) {
    SimOptions options;
    options.actors = mutant.actors;
    options.seed = seed;
    if (!mutant.is_of_lies) options.byzantine = ByzantineSeeds::kNone;
    mutant.apply(options);
    const SimReport report = RunSimulatedMission(options);
    if (report.violations.empty()) continue;
    const Violation& first = report.violations.front();
    std::cout << mutant.what << ": caught at seed " << seed << " by " << first.rule << ": " << first.text << "\n";
    EXPECT_THAT(mutant.invariants, testing::Contains(first.rule));
    return;
  }
  FAIL() << mutant.what << ": not caught in " << mutant.seeds << " seeds";
}

INSTANTIATE_TEST_SUITE_P(All, MutantTest, testing::ValuesIn(Mutants()),
                         [](const auto& param) { return param.param.name; });

}  // namespace
}  // namespace moondb::simulation
