// Lets any actor fail, or kills any agent, at any message. Checks that no acknowledged record is lost, and that the
// team recovers.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
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

// Returns how many messages of each kind each fault strikes. The environment variable MOONDB_FAULTS sets this number;
// 1000 strikes all messages.
std::size_t FaultsOfAKind() {
  const char* text = std::getenv("MOONDB_FAULTS");
  return text == nullptr ? 2 : static_cast<std::size_t>(std::max(1, std::atoi(text)));
}
// Maps a kind of message, for example "storage insert_request", to the numbers of its messages.
using Kinds = std::map<std::string, std::vector<std::uint64_t>>;

Kinds KindsOf(const std::vector<std::string>& handled) {
  Kinds kinds;
  for (std::size_t i = 0; i < handled.size(); ++i) kinds[handled[i]].push_back(i + 1);
  return kinds;
}

// For each fault, chooses messages spread evenly over the messages of each kind, including rare kinds. Different faults
// strike different messages if the kind has enough of them.
std::vector<Strike> ChooseStrikes(const Kinds& kinds, bool kills_agent) {
  std::vector<Strike> strikes;
  for (const auto& [kind, messages] : kinds) {
    const std::size_t count = std::min(FaultsOfAKind(), messages.size());
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t fault = 0; fault < std::size(kFaults); ++fault) {
        const std::size_t place = (i * std::size(kFaults) + fault) * messages.size() / (count * std::size(kFaults));
        const bool is_all = count == messages.size();
        strikes.push_back({messages[is_all ? i : place], kFaults[fault], kills_agent});
      }
    }
  }
  return strikes;
}

// The parameter is the argument `batches` of RunLosses. With 2, links break early in the sync and in the replication.
// With 100, links break at the end.
class LossesTest : public testing::TestWithParam<int> {};

TEST_P(LossesTest, TheSurvivorSolvesAndMergesAllRecordsThatItAcknowledged) {
  const MissionReport report = RunLosses(kSeed, GetParam());
  for (const std::string& fault : report.faults) ADD_FAILURE() << fault;
  std::cout << report.kept_count << " records of others\n";
  EXPECT_GT(report.kept_count, 0u);
}

INSTANTIATE_TEST_SUITE_P(Batches, LossesTest, testing::Values(2, 4, 8, 16, 100));

TEST(MissionTest, SucceedsWithoutFaults) {
  const MissionReport report = RunMission(kSeed, {});
  for (const std::string& fault : report.faults) ADD_FAILURE() << fault;
  for (const auto& [kind, messages] : KindsOf(report.handled)) std::cout << kind << ": " << messages.size() << "\n";
  std::cout << report.handled.size() << " messages\n";
  EXPECT_EQ(RunMission(kSeed, {}).handled, report.handled) << "equal runs";
}

class CrashTest : public testing::TestWithParam<std::uint64_t> {
 protected:
  // Silences the log. Otherwise each deliberate failure would log a warning.
  static void SetUpTestSuite() { spdlog::set_level(spdlog::level::critical); }

  // Runs one mission. Returns false if five missions have failed so far; the caller then stops.
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

  // Runs one mission for each strike of this shard.
  void StrikeEach(bool kills_agent) {
    const std::vector<Strike> strikes = ChooseStrikes(KindsOf(RunMission(kSeed, {}).handled), kills_agent);
    for (std::size_t i = GetParam(); i < strikes.size(); i += kShards) {
      if (!Try(kSeed, {strikes[i]})) return;
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

// Later faults strike states that earlier faults caused. The environment variable MOONDB_SEEDS sets the number of
// missions.
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
