#include "actors/registration/match_plan.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

class MatchPlanTest : public testing::Test {
 protected:
  // Adds `count` maps of an agent in a row along x, `step_m` apart. Nodes are far apart in number.
  void AddRow(AgentId agent, int count, double step_m, double y_m) {
    for (int i = 0; i < count; ++i) {
      RegisteredMap map;
      map.key = {{agent, 1, 40}, static_cast<std::uint64_t>(i + 1)};
      map.node = {agent, static_cast<std::uint64_t>(20 * i)};
      map.map_from_local = Pose::FromPlanar(i * step_m, y_m, 0);
      maps_.push_back(map);
    }
  }

  std::vector<PlannedMatch> Plan() {
    return plan_.StartPass(maps_, [](AgentId, AgentId) { return true; });
  }

  static std::map<MatchPlan::AgentPair, std::size_t> Count(const std::vector<PlannedMatch>& planned) {
    std::map<MatchPlan::AgentPair, std::size_t> counts;
    for (const PlannedMatch& match : planned) {
      ++counts[std::minmax(AgentId{match.first.node.agent}, AgentId{match.second.node.agent})];
    }
    return counts;
  }

  static MatchPlan::Options Options() {
    MatchPlan::Options options;
    options.pairs_max = 60;
    options.pair_work_max = 100;
    return options;
  }

  std::vector<RegisteredMap> maps_;
  MatchPlan plan_{Options()};
};

// The maps of agent 3 lie half a metre apart, so each of their pairs is nearer than all others.
TEST_F(MatchPlanTest, ManyNearMapsOfOneAgentTakeNoPairsFromOthers) {
  AddRow(1, 5, 2, 0);
  AddRow(2, 5, 2, 2);
  const auto honest = Count(Plan());
  AddRow(3, 300, 0.5, 300);
  const std::vector<PlannedMatch> planned = Plan();
  const auto counts = Count(planned);
  for (const auto& [agents, count] : honest) EXPECT_EQ(counts.at(agents), count) << agents.first << agents.second;
  EXPECT_LE(planned.size(), 60u);
  const auto left_out = plan_.CountLeftOut();
  ASSERT_EQ(left_out.size(), 1u);
  EXPECT_GT(left_out.at({3, 3}), 500u);
}

TEST_F(MatchPlanTest, PairsOfAgentsWithTooManyPairsHaveEqualParts) {
  AddRow(1, 100, 1, 0);
  AddRow(2, 100, 1, 0.5);
  EXPECT_EQ(Count(Plan()), (std::map<MatchPlan::AgentPair, std::size_t>{{{1, 1}, 20}, {{1, 2}, 20}, {{2, 2}, 20}}));
}

TEST_F(MatchPlanTest, WorkOfOnePairOfAgentsLeavesThatOfOthers) {
  AddRow(1, 6, 2, 0);
  AddRow(3, 6, 2, 300);
  MatchResult noise;
  noise.work = 1000;
  std::map<AgentId, std::size_t> matched;
  const std::vector<PlannedMatch> planned = Plan();
  for (const PlannedMatch& match : planned) {
    if (!plan_.HasWorkFor(match)) continue;
    ++matched[match.first.node.agent];
    plan_.Note(match, match.first.node.agent == 3 ? noise : MatchResult());
  }
  const auto counts = Count(planned);
  EXPECT_EQ(matched[1], counts.at({1, 1}));
  EXPECT_EQ(matched[3], (counts.at({3, 3}) + 9) / 10) << "each takes the work of ten pairs";
  EXPECT_EQ(plan_.CountLeftOut(),
            (std::map<MatchPlan::AgentPair, std::size_t>{{{3, 3}, counts.at({3, 3}) - matched[3]}}));
}

TEST_F(MatchPlanTest, PairsThatWereLeftOutAreDueInTheNextPass) {
  AddRow(1, 100, 1, 0);
  const std::vector<PlannedMatch> first = Plan();
  MatchResult accepted;
  accepted.verdict = MatchVerdict::kAccepted;
  for (const PlannedMatch& match : first) plan_.Note(match, accepted);
  for (const PlannedMatch& match : Plan()) {
    for (const PlannedMatch& other : first) {
      EXPECT_FALSE(match.first.key == other.first.key && match.second.key == other.second.key);
    }
  }
}

}  // namespace
}  // namespace moondb
