// Tests that the solver refuses the measurements of a rover that lies, names it, and lets its lies move no other rover.
#include "actors/pgo/agent_contradictions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "actors/pgo/pose_graph_solver.h"
#include "tests/actors/pgo/scenario_test.h"

namespace moondb {
namespace {

using simulation::LoopClosureOf;
using simulation::MakeScenario;

constexpr AgentId kLiar = 3;

class AgentContradictionsTest : public simulation::ScenarioTest {
 protected:
  void Use(std::uint64_t seed) {
    scenario_ = MakeScenario({.seed = seed, .outlier_ratio = 0.05});
    rng_.seed(seed);
    for (RangeEdge& range : scenario_.graph.ranges) range.producer = range.from.agent;
    honest_ = Solve();
    EXPECT_TRUE(honest_.refused.empty());
  }

  // Loop closures from the liar's nodes to all others, moved by `offset_m` in the frame of the liar's node.
  void AddClosures(int sources, const Eigen::Vector3d& offset_m) {
    for (int source = 0; source < sources; ++source) {
      for (const AgentId other : {1, 2}) {
        for (std::uint64_t i = 5; i < 100; i += 5) {
          LoopClosure closure =
              LoopClosureOf(scenario_, {kLiar, i}, {other, i}, "tool" + std::to_string(source), rng_, offset_m);
          closure.producer = kLiar;
          scenario_.graph.closures.push_back(closure);
        }
      }
    }
  }

  // Ranges from eight of the liar's nodes to many nodes of the others, as if the liar stood `offset_m` beside its
  // place.
  void AddRanges(double sigma_m, const Eigen::Vector3d& offset_m) {
    for (const AgentId other : {1, 2}) {
      for (std::uint64_t i = 6; i < 100; i += 12) {
        for (std::uint64_t j = 1; j < 100; j += 3) {
          RangeEdge range;
          range.from = {kLiar, i};
          range.to = {other, j};
          range.range_m = (AntennaAt(range.from) + offset_m - AntennaAt(range.to)).norm();
          range.variance_m2 = sigma_m * sigma_m;
          range.producer = kLiar;
          scenario_.graph.ranges.push_back(range);
        }
      }
    }
  }

  Eigen::Vector3d AntennaAt(const NodeKey& node) const {
    return scenario_.truth.at(node) * scenario_.agents.at(node.agent).antenna_m;
  }

  // Returns the largest median distance between the poses of another rover in `solution` and in honest_.
  double MoveOfOthersM(const Solution& solution) const {
    double largest = 0;
    for (const AgentId other : {1, 2}) {
      std::vector<double> moves;
      for (const auto& [node, pose] : honest_.poses) {
        if (node.agent == other) moves.push_back((solution.poses.at(node).position_m - pose.position_m).norm());
      }
      std::ranges::sort(moves);
      largest = std::max(largest, moves[moves.size() / 2]);
    }
    return largest;
  }

  static bool Names(const Solution& solution, AgentId agent) {
    return std::ranges::any_of(solution.refused, [agent](const FactorSet& set) { return set.producer == agent; });
  }

  void ExpectTheLiarIsNamedAlone(const std::string& lie) {
    SCOPED_TRACE(lie);
    const Solution solution = Solve();
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    EXPECT_TRUE(Names(solution, kLiar));
    EXPECT_FALSE(Names(solution, 1));
    EXPECT_FALSE(Names(solution, 2));
    EXPECT_LT(MoveOfOthersM(solution), 0.3);
  }

  Solution honest_;
};

TEST_F(AgentContradictionsTest, ClosuresUnderAnyNumberOfSourcesMoveNobody) {
  for (const int sources : {1, 4, 40}) {
    Use(1);
    AddClosures(sources, {1, 0.5, 0});
    ExpectTheLiarIsNamedAlone(std::to_string(sources) + " sources");
  }
}

TEST_F(AgentContradictionsTest, RangesOfAnyStatedSigmaMoveNobody) {
  for (const double sigma_m : {0.001, 0.1, 0.5}) {
    Use(2);
    AddRanges(sigma_m, {2, -1, 0});
    ExpectTheLiarIsNamedAlone("sigma " + std::to_string(sigma_m));
  }
}

TEST_F(AgentContradictionsTest, FalseClosuresAndRangesTogetherDoNoMoreThanWithholdingTheTrueOnes) {
  Use(3);
  const PoseGraph whole = scenario_.graph;
  std::erase_if(scenario_.graph.ranges, [](const RangeEdge& range) { return range.producer == kLiar; });
  honest_ = Solve();
  scenario_.graph = whole;
  AddClosures(10, {1.5, 0, 0});
  AddRanges(0.1, {1.5, 0, 0});
  ExpectTheLiarIsNamedAlone("closures and ranges");
}

TEST_F(AgentContradictionsTest, TrueMeasurementsOfTheLiarStay) {
  Use(4);
  AddClosures(4, {1, 0.5, 0});
  const Solution solution = Solve();
  EXPECT_LT(MoveOfOthersM(solution), 0.01) << "the liar's true ranges must go on to count";
  for (const FactorSet& set : solution.refused) EXPECT_EQ(set.kind, FactorKind::kLoopClosure);
}

TEST_F(AgentContradictionsTest, OneSourceThatIsWrongCostsNoOtherSource) {
  Use(5);
  AddClosures(1, Eigen::Vector3d::Zero());
  for (LoopClosure& closure : scenario_.graph.closures) closure.source = "right";
  AddClosures(1, {1, 0.5, 0});
  const Solution solution = Solve();
  for (const FactorSet& set : solution.refused) EXPECT_EQ(set.source, "tool0");
  std::size_t accepted = 0;
  for (const FactorVerdict& verdict : solution.verdicts)
    accepted += verdict.factor.source == "right" && verdict.is_inlier;
  EXPECT_GE(accepted, 36u) << "of 38";
}

TEST_F(AgentContradictionsTest, TrueClosuresAndRangesAreNeverRefused) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Use(seed);
    AddClosures(2, Eigen::Vector3d::Zero());
    AddRanges(0.1, Eigen::Vector3d::Zero());
    const Solution solution = Solve();
    EXPECT_TRUE(solution.refused.empty());
    const std::size_t rejected = solution.CountOf(FactorKind::kLoopClosure).rejected;
    for (LoopClosure& closure : scenario_.graph.closures) closure.producer = 0;
    for (RangeEdge& range : scenario_.graph.ranges) range.producer = 0;
    EXPECT_EQ(rejected, Solve().CountOf(FactorKind::kLoopClosure).rejected) << "the test of agents costs no closure";
  }
}

TEST_F(AgentContradictionsTest, HonestTeamsOf16And64AgentsNameNobodyAndLoseNoClosure) {
  for (const auto& [rovers, nodes] : {std::pair(15, 24), std::pair(63, 8)}) {
    SCOPED_TRACE(std::to_string(rovers) + " rovers");
    scenario_ = MakeScenario({.seed = 1, .rover_count = rovers, .node_count = nodes, .outlier_ratio = 0.05});
    rng_.seed(1);
    for (RangeEdge& range : scenario_.graph.ranges) range.producer = range.from.agent;
    for (AgentId agent = 1; agent < static_cast<AgentId>(rovers); ++agent) {
      for (std::uint64_t i = 2; i < static_cast<std::uint64_t>(nodes); i += 3) {
        LoopClosure closure = LoopClosureOf(scenario_, {agent, i}, {agent + 1, i}, "tags", rng_);
        closure.producer = agent;
        scenario_.graph.closures.push_back(closure);
      }
    }
    const Solution solution = Solve();
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    EXPECT_TRUE(solution.refused.empty());
    for (LoopClosure& closure : scenario_.graph.closures) closure.producer = 0;
    for (RangeEdge& range : scenario_.graph.ranges) range.producer = 0;
    EXPECT_EQ(solution.CountOf(FactorKind::kLoopClosure).rejected, Solve().CountOf(FactorKind::kLoopClosure).rejected);
  }
}

TEST_F(AgentContradictionsTest, AWarmSolveFindsTheLiarToo) {
  Use(6);
  const LastSolution last = ToLast(honest_);
  AddClosures(40, {1, 0.5, 0});
  const Solution solution = Solve(last);
  EXPECT_TRUE(Names(solution, kLiar));
  EXPECT_LT(MoveOfOthersM(solution), 0.3);
  const Solution again = Solve(ToLast(solution));
  EXPECT_TRUE(Names(again, kLiar)) << "the next solve must not take the lie back in";
  EXPECT_LT(MoveOfOthersM(again), 0.3);
}

TEST_F(AgentContradictionsTest, MeasurementsOfUnknownProducersAreTestedAsSetsOnly) {
  Use(7);
  for (RangeEdge& range : scenario_.graph.ranges) range.producer = 0;
  AddRanges(0.1, {2, -1, 0});
  for (RangeEdge& range : scenario_.graph.ranges) range.producer = 0;
  EXPECT_TRUE(Solve().refused.empty());
}

TEST(ContradictionTest, TheWordOfOneAgentAccusesNobody) {
  // Agent 3 contradicts agents 1 and 2. They contradict agent 3, and hardly each other.
  const std::map<AgentId, Contradiction> found = {
      {1, {.rises = {{1, 0.1}, {2, 0.1}, {3, 4.0}}, .lost = {}}},
      {2, {.rises = {{1, 0.2}, {3, 3.0}}, .lost = {{3, 1.0}}}},
      {3, {.rises = {{1, 0.7}, {2, 0.6}}, .lost = {}}},
  };
  EXPECT_EQ(FindLiar(found), 3u);
  EXPECT_EQ(found.at(1).FindAccuser(1), 3u);
  EXPECT_NEAR(found.at(1).Excess(3), 0.2, 1e-12);
}

}  // namespace
}  // namespace moondb
