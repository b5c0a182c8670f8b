// Tests that messages of a Byzantine agent reach honest agents. Some of these messages violate invariants in teams
// without signing keys, and none does in teams with keys.
#include "apps/moondb_sim/byzantine_agent.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <iostream>

#include "apps/moondb_sim/simulated_mission.h"

namespace moondb::simulation {

// Prints the parameter in gtest's messages.
void PrintTo(const AttackKind& kind, std::ostream* out) { *out << kind.name; }

namespace {

constexpr std::uint64_t kWithoutKeys = 1;
constexpr std::uint64_t kWithKeys = 4;

SimOptions Options(std::uint64_t seed, const std::string& attack) {
  SimOptions options;
  options.actors = SimulatedActors::kSharing;
  options.seed = seed;
  options.hours = 0.5;
  options.is_faultless = true;
  options.byzantine = ByzantineSeeds::kAll;
  options.attacks = {attack};
  return options;
}

void Print(const SimReport& report) {
  for (const Violation& violation : report.violations) {
    std::cout << violation.rule << " at " << violation.time_s << " s: " << violation.text << "\n";
  }
}

class Quiet : public testing::Environment {
  void SetUp() override { spdlog::set_level(spdlog::level::off); }
};
const auto* const quiet = testing::AddGlobalTestEnvironment(new Quiet);

class AttackTest : public testing::TestWithParam<AttackKind> {};

TEST_P(AttackTest, IsHeardAndBreaksNoRuleOfATeamWithKeys) {
  const SimReport report = RunSimulatedMission(Options(kWithKeys, GetParam().name));
  Print(report);
  EXPECT_TRUE(report.violations.empty());
  for (const AttackKind& kind : AttackKinds()) {
    const bool is_heard = report.rare.contains(RareStateOf(kind));
    // The attack "order" needs gateways, which this mission does not have.
    EXPECT_EQ(is_heard, kind.name == GetParam().name && kind.name != "order") << kind.name;
  }
}

INSTANTIATE_TEST_SUITE_P(All, AttackTest, testing::ValuesIn(AttackKinds()),
                         [](const auto& param) { return param.param.name; });

class LieTest : public testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(LieTest, BreaksTheRuleOfATeamWithoutKeys) {
  const auto& [attack, rule] = GetParam();
  const SimReport report = RunSimulatedMission(Options(kWithoutKeys, attack));
  Print(report);
  ASSERT_FALSE(report.violations.empty());
  EXPECT_EQ(report.violations.front().rule, rule);
}

INSTANTIATE_TEST_SUITE_P(All, LieTest,
                         testing::Values(std::pair("forge", "only_own_lies"), std::pair("event", "only_own_lies"),
                                         std::pair("announce", "honest_roles")),
                         [](const auto& param) { return param.param.first; });

TEST(ByzantineAgentTest, ChangesNothingOfRunsWithoutOne) {
  SimOptions options = Options(kWithoutKeys, "forge");
  options.byzantine = ByzantineSeeds::kSome;
  const SimReport report = RunSimulatedMission(options);
  options.byzantine = ByzantineSeeds::kNone;
  EXPECT_EQ(report.trace_hash, RunSimulatedMission(options).trace_hash);
}

TEST(ByzantineAgentTest, IsInEverySecondSeedWithKeysAndNeverHasARoleInTheTeamFile) {
  SimOptions options;
  int count = 0;
  for (options.seed = 1; options.seed <= 40; ++options.seed) {
    const AgentId byzantine = options.Byzantine();
    if (byzantine == 0) continue;
    ++count;
    EXPECT_EQ(options.seed % 2, 0u);
    EXPECT_GE(byzantine, 3u);
    EXPECT_LE(static_cast<int>(byzantine), options.RoverCount());
  }
  EXPECT_EQ(count, 10);
}

TEST(ByzantineAgentTest, AttacksAreNamed) {
  SimOptions options;
  EXPECT_TRUE(SetAttacks("forge,flood", options));
  EXPECT_EQ(options.attacks, (std::set<std::string>{"forge", "flood"}));
  const Result<void> unknown = SetAttacks("forge,charm", options);
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().text.find("'charm'"), std::string::npos);
  EXPECT_NE(unknown.error().text.find("announce"), std::string::npos);
  EXPECT_FALSE(SetAttacks("", options));
}

}  // namespace
}  // namespace moondb::simulation
