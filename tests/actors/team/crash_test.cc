// Any actor crashed, or any agent killed, at any message: nothing acknowledged is lost, and the team goes on.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "tests/actors/team/mission.h"

namespace moondb {
namespace {

using simulation::Fault;

constexpr std::uint64_t kSeed = 1;
constexpr std::uint64_t kShards = 8;
constexpr Fault kFaults[] = {Fault::kBeforeHandler, Fault::kAtFirstSend, Fault::kAfterFirstSend, Fault::kAfterHandler};

// Every how many-th message is struck. MOONDB_FAULTS_EVERY=1 tries all.
std::uint64_t Stride() {
  const char* text = std::getenv("MOONDB_FAULTS_EVERY");
  return text == nullptr ? 13 : static_cast<std::uint64_t>(std::max(1, std::atoi(text)));
}

TEST(MissionTest, EndsWellWithoutFaults) {
  const MissionReport report = RunMission(kSeed, {});
  for (const std::string& fault : report.faults) ADD_FAILURE() << fault;
  for (const auto& [actor, count] : report.by_actor) std::cout << actor << " handles " << count << "\n";
  std::cout << "messages: " << report.message_count << "\n";
  EXPECT_EQ(RunMission(kSeed, {}).message_count, report.message_count) << "equal runs";
}

class CrashTest : public testing::TestWithParam<std::uint64_t> {
 protected:
  // Each failure on purpose is a warning otherwise.
  static void SetUpTestSuite() { spdlog::set_level(spdlog::level::critical); }

  // One mission; false when enough have failed.
  bool Try(std::uint64_t seed, const std::vector<Strike>& strikes) {
    const MissionReport report = RunMission(seed, strikes);
    tried_ += report.struck.size();
    if (report.faults.empty()) return true;
    std::string what = "seed " + std::to_string(seed);
    for (const Strike& strike : strikes) what += "; " + ToString(strike);
    for (const std::string& struck : report.struck) what += "; " + struck;
    for (const std::string& fault : report.faults) ADD_FAILURE() << what << ": " << fault;
    return ++failed_ < 5;
  }

  // Strikes this shard's share of all messages, one a mission.
  void StrikeEach(bool kills_agent) {
    const std::uint64_t count = RunMission(kSeed, {}).message_count;
    for (std::uint64_t message = 1 + GetParam(); message <= count; message += kShards) {
      for (const Fault fault : kFaults) {
        // Neighbouring messages get different faults, so that each actor meets all of them.
        if ((message + static_cast<std::uint64_t>(fault)) % Stride() != 0) continue;
        if (!Try(kSeed, {{message, fault, kills_agent}})) return;
      }
    }
  }

  void TearDown() override {
    RecordProperty("faults", static_cast<int>(tried_));
    std::cout << tried_ << " faults struck\n";
    EXPECT_GT(tried_, 0u);
  }

 private:
  std::size_t tried_ = 0;
  int failed_ = 0;
};

TEST_P(CrashTest, ActorsFailAtAnyMessage) { StrikeEach(/*kills_agent=*/false); }
TEST_P(CrashTest, AgentsAreKilledAtAnyMessage) { StrikeEach(/*kills_agent=*/true); }

// Faults in what other faults left behind. MOONDB_SEEDS sets how many missions.
TEST_P(CrashTest, SeveralFaultsStrikeOneMission) {
  const char* text = std::getenv("MOONDB_SEEDS");
  const std::uint64_t seeds = text == nullptr ? 6 : static_cast<std::uint64_t>(std::max(1, std::atoi(text)));
  const std::uint64_t first = 1 + GetParam() * seeds;
  std::cout << "seeds " << first << " to " << first + seeds - 1 << "\n";
  for (std::uint64_t seed = first; seed < first + seeds; ++seed) {
    std::mt19937_64 rng(seed);
    std::vector<Strike> strikes;
    for (std::uint64_t message = 1 + rng() % 200; message < 800; message += 1 + rng() % 200) {
      strikes.push_back({message, kFaults[rng() % std::size(kFaults)], rng() % 3 == 0});
    }
    if (!Try(seed, strikes)) return;
  }
}

INSTANTIATE_TEST_SUITE_P(Shards, CrashTest, testing::Range(std::uint64_t{0}, kShards));

}  // namespace
}  // namespace moondb
