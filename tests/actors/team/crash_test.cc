// Any actor crashed, or any agent killed, at any message: nothing acknowledged is lost, and the team goes on.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>

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
  // Strikes this shard's share of all messages, one a run.
  static void StrikeEach(bool kills_agent) {
    const std::uint64_t count = RunMission(kSeed, {}).message_count;
    int tried = 0;
    int failed = 0;
    for (std::uint64_t message = 1 + GetParam(); message <= count; message += kShards) {
      for (const Fault fault : kFaults) {
        // Neighbouring messages get different faults, so that each actor meets all of them.
        if ((message + static_cast<std::uint64_t>(fault)) % Stride() != 0) continue;
        const Strike strike{message, fault, kills_agent};
        const MissionReport report = RunMission(kSeed, strike);
        ++tried;
        if (report.faults.empty()) continue;
        ++failed;
        for (const std::string& text : report.faults) {
          ADD_FAILURE() << ToString(strike) << " (" << report.struck << "): " << text;
        }
        if (failed >= 5) return;
      }
    }
    RecordProperty("faults", tried);
    std::cout << "seed " << kSeed << ", " << count << " messages, " << tried << " faults tried\n";
    EXPECT_GT(tried, 0);
  }
};

TEST_P(CrashTest, ActorsFailAtAnyMessage) { StrikeEach(/*kills_agent=*/false); }
TEST_P(CrashTest, AgentsAreKilledAtAnyMessage) { StrikeEach(/*kills_agent=*/true); }

INSTANTIATE_TEST_SUITE_P(Shards, CrashTest, testing::Range(std::uint64_t{0}, kShards));

}  // namespace
}  // namespace moondb
