#include "actors/pgo/pose_graph_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "model/metrics.h"
#include "tests/actors/pgo/scenario.h"

namespace moondb {
namespace {

using simulation::MakeScenario;
using simulation::Scenario;
using simulation::ScenarioOptions;
using simulation::TrajectoryErrorM;

class PoseGraphSolverTest : public testing::Test {
 protected:
  PoseGraphSolverTest() { options_.thread_count = 1; }

  Solution Solve(const Scenario& scenario, const LastSolution& last = {}) {
    return SolvePoseGraph(scenario.graph, scenario.agents, last, options_);
  }

  SolverOptions options_;
};

TEST_F(PoseGraphSolverTest, ComesNearerToTheTruthThanOdometry) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .scale_errors = {0.02, -0.02, 0.01}});
    const Solution solution = Solve(scenario);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.5);
    EXPECT_GT(TrajectoryErrorM(scenario, PosesOf(scenario.graph)), 2 * TrajectoryErrorM(scenario, solution.poses));
    EXPECT_LT(solution.final_cost, solution.initial_cost);
  }
}

TEST_F(PoseGraphSolverTest, FindsTheLongRanges) {
  for (const std::uint64_t seed : {4, 5}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.15});
    const Solution solution = Solve(scenario);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    ASSERT_EQ(solution.ranges.size(), scenario.is_outlier.size());
    std::map<std::pair<NodeKey, NodeKey>, bool> is_outlier;
    for (std::size_t i = 0; i < scenario.is_outlier.size(); ++i) {
      is_outlier[{scenario.graph.ranges[i].from, scenario.graph.ranges[i].to}] = scenario.is_outlier[i];
    }
    std::size_t wrong = 0;
    for (const RangeVerdict& range : solution.ranges) wrong += range.is_inlier == is_outlier.at({range.from, range.to});
    EXPECT_LE(wrong, solution.ranges.size() / 50);
    EXPECT_GT(solution.rejected_range_count, 5u);
    EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.25);
  }
}

TEST_F(PoseGraphSolverTest, RecoversEachRoversScale) {
  const Scenario scenario = MakeScenario({.seed = 6, .scale_errors = {0.03, -0.025, 0}});
  const Solution solution = Solve(scenario);
  ASSERT_EQ(solution.rovers.size(), 3u);
  EXPECT_NEAR(solution.rovers[0].odometry_scale, 1.03, 0.008);
  EXPECT_NEAR(solution.rovers[1].odometry_scale, 0.975, 0.008);
  EXPECT_NEAR(solution.rovers[2].odometry_scale, 1, 0.008);
}

TEST_F(PoseGraphSolverTest, NeedsTheScaleTheAntennasAndGravity) {
  const Scenario scenario = MakeScenario({.seed = 7,
                                          .range_sigma_m = 0.05,
                                          .scale_errors = {0.03, -0.03, 0.03},
                                          .tilt_noise_rad = 0.01,
                                          .antenna_m = {0.8, -0.5, 1}});
  const double best_m = TrajectoryErrorM(scenario, Solve(scenario).poses);

  options_.scale_sigma = 1e-6;
  EXPECT_GT(TrajectoryErrorM(scenario, Solve(scenario).poses), 1.3 * best_m) << "without scale";
  options_ = SolverOptions{.thread_count = 1};

  options_.gravity_sigma_rad = 1e3;
  EXPECT_GT(TrajectoryErrorM(scenario, Solve(scenario).poses), 1.3 * best_m) << "without gravity";
  options_ = SolverOptions{.thread_count = 1};

  Scenario without_antennas = scenario;
  for (auto& [agent, facts] : without_antennas.agents) facts.antenna_m.setZero();
  EXPECT_GT(TrajectoryErrorM(scenario, Solve(without_antennas).poses), 1.3 * best_m) << "without antennas";
}

TEST_F(PoseGraphSolverTest, AbsorbsABiasOfEachPair) {
  const Scenario scenario = MakeScenario({.seed = 8, .bias_sigma_m = 0.15});
  const double with_bias_m = TrajectoryErrorM(scenario, Solve(scenario).poses);
  options_.bias_sigma_m = 1e-6;
  EXPECT_LT(with_bias_m, TrajectoryErrorM(scenario, Solve(scenario).poses));
}

TEST_F(PoseGraphSolverTest, GivesTheSameSolutionWhateverTheOrderOfArrival) {
  Scenario scenario = MakeScenario({.seed = 9, .node_count = 40, .outlier_ratio = 0.1});
  const Solution first = Solve(scenario);
  std::mt19937_64 rng(9);
  std::shuffle(scenario.graph.nodes.begin(), scenario.graph.nodes.end(), rng);
  std::shuffle(scenario.graph.odometry.begin(), scenario.graph.odometry.end(), rng);
  std::shuffle(scenario.graph.ranges.begin(), scenario.graph.ranges.end(), rng);
  const Solution second = Solve(scenario);
  EXPECT_EQ(first.final_cost, second.final_cost);
  for (const auto& [key, pose] : first.poses) EXPECT_EQ(pose.position_m, second.poses.at(key).position_m);
}

TEST_F(PoseGraphSolverTest, StaysWhereItIsWhenSolvedAgain) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.15, .bias_sigma_m = 0.1});
    const Solution first = Solve(scenario);
    const Solution again = Solve(scenario, ToLast(first));
    ASSERT_TRUE(again.is_accepted) << again.text;
    EXPECT_EQ(again.rejected_range_count, first.rejected_range_count);
    for (const auto& [key, pose] : first.poses) {
      ASSERT_LT((pose.position_m - again.poses.at(key).position_m).norm(), 1e-4) << ToString(key);
    }
  }
}

TEST_F(PoseGraphSolverTest, MovesOnlyTheNewestNodesInAWindow) {
  const Scenario scenario = MakeScenario({.seed = 18, .scale_errors = {0.02, -0.02, 0.01}, .bias_sigma_m = 0.1});
  Scenario earlier = scenario;
  const auto is_late = [](const auto& item) { return item.stamp_ns > 900'000'000'000; };
  std::erase_if(earlier.graph.nodes, is_late);
  std::erase_if(earlier.graph.odometry, is_late);
  std::erase_if(earlier.graph.ranges, is_late);
  const Solution last = Solve(earlier);
  const Solution all = Solve(scenario, ToLast(last));
  options_.window_nodes = 50;
  const Solution window = Solve(scenario, ToLast(last));
  ASSERT_TRUE(window.is_accepted) << window.text;
  EXPECT_EQ(window.poses.at({1, 49}).position_m, last.poses.at({1, 49}).position_m);
  EXPECT_NE(window.poses.at({1, 50}).position_m, last.poses.at({1, 50}).position_m);
  EXPECT_LT(window.ranges.size(), all.ranges.size());
  for (AgentId agent = 1; agent <= 3; ++agent) {
    EXPECT_LT((window.poses.at({agent, 99}).position_m - all.poses.at({agent, 99}).position_m).norm(), 0.1);
  }
}

TEST_F(PoseGraphSolverTest, GoesOnFromTheLastSolution) {
  const ScenarioOptions options{.seed = 11, .scale_errors = {0.03, 0.03, 0.03}};
  const Scenario scenario = MakeScenario(options);
  Scenario half = scenario;
  const auto is_late = [](const auto& item) { return item.stamp_ns > 500'000'000'000; };
  std::erase_if(half.graph.nodes, is_late);
  std::erase_if(half.graph.odometry, is_late);
  std::erase_if(half.graph.ranges, is_late);
  const Solution first = Solve(half);
  const Solution second = Solve(scenario, ToLast(first));
  ASSERT_TRUE(second.is_accepted) << second.text;
  EXPECT_NEAR(second.final_cost, Solve(scenario).final_cost, 1e-3);
}

TEST_F(PoseGraphSolverTest, SaysWhenThereIsNothingToSolve) {
  const Solution nothing = SolvePoseGraph({}, {}, {}, options_);
  EXPECT_TRUE(nothing.is_accepted);
  EXPECT_EQ(nothing.text, "no rover has a node yet");
  EXPECT_TRUE(nothing.poses.empty());
}

TEST_F(PoseGraphSolverTest, HoldsASingleNodeAtItsStart) {
  PoseGraph graph;
  graph.nodes = {GraphNode{{1, 0}, 0, Pose::FromPlanar(3.2, 1, 0)}};
  const AgentFactsMap agents = {{1, AgentFacts{.agent = 1, .start = Pose::FromPlanar(3, 1, 0.5)}}};
  const Solution solution = SolvePoseGraph(graph, agents, {}, options_);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_LT((solution.poses.at({1, 0}).position_m - Eigen::Vector3d(3, 1, 0)).norm(), 1e-6);
  EXPECT_NEAR(solution.poses.at({1, 0}).Yaw(), 0.5, 1e-6);
}

TEST_F(PoseGraphSolverTest, FollowsOdometryAloneWithoutRangesAndSaysSo) {
  Scenario scenario = MakeScenario({.seed = 12});
  scenario.graph.ranges.clear();
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  for (const RoverResult& rover : solution.rovers) {
    EXPECT_EQ(rover.anchoring, Anchoring::kNoRanges);
    EXPECT_NE(rover.text, "");
  }
}

TEST_F(PoseGraphSolverTest, TellsARoverThatNothingTiesToTheMap) {
  Scenario scenario = MakeScenario({.seed = 13});
  scenario.agents.at(2).start.reset();
  std::erase_if(scenario.graph.ranges, [](const RangeEdge& r) { return r.from.agent == 2 || r.to.agent == 2; });
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  ASSERT_EQ(solution.rovers.size(), 3u);
  EXPECT_EQ(solution.rovers[0].anchoring, Anchoring::kAnchored);
  EXPECT_EQ(solution.rovers[0].text, "");
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kUnanchored);
  EXPECT_THAT(solution.rovers[1].text, testing::HasSubstr("no start pose configured"));
}

TEST_F(PoseGraphSolverTest, AnchorsByRangesARoverWithoutAConfiguredStart) {
  Scenario scenario = MakeScenario({.seed = 14});
  scenario.agents.at(2).start.reset();
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAnchored);
  EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.4);
}

TEST_F(PoseGraphSolverTest, LeavesOutDamageAndSolvesTheRest) {
  Scenario scenario = MakeScenario({.seed = 15});
  const double clean_m = TrajectoryErrorM(scenario, Solve(scenario).poses);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  scenario.graph.ranges.push_back(RangeEdge{{1, 4}, {2, 4}, 0, nan, 0.01});
  scenario.graph.ranges.push_back(RangeEdge{{1, 4}, {2, 4000}, 0, 3, 0.01});
  scenario.graph.odometry.push_back(OdometryEdge{{1, 4}, {1, 5}, 0, {}, Matrix6d::Constant(nan)});
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.left_out.at(1).count, 3u);
  EXPECT_THAT(solution.rovers[0].text, testing::StartsWith("3 records left out, first: odometry from agent 1, node 4"));
  EXPECT_NEAR(TrajectoryErrorM(scenario, solution.poses), clean_m, 1e-9);
}

TEST_F(PoseGraphSolverTest, BridgesAGapInTheOdometry) {
  Scenario scenario = MakeScenario({.seed = 16});
  std::erase_if(scenario.graph.odometry, [](const OdometryEdge& e) { return e.to == NodeKey{2, 50}; });
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_THAT(solution.rovers[1].text, testing::HasSubstr("interrupted in 1 place"));
  EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.4);
}

TEST_F(PoseGraphSolverTest, KeepsTheOldPosesWhenStopped) {
  const Scenario scenario = MakeScenario({.seed = 17, .node_count = 20});
  options_.stop_requested = [] { return true; };
  std::map<NodeKey, Pose> last = PosesOf(scenario.graph);
  const Solution solution = Solve(scenario, {.poses = last, .rejected = {}});
  EXPECT_FALSE(solution.is_accepted);
  EXPECT_NE(solution.text, "");
  EXPECT_TRUE(solution.ranges.empty());
  for (const auto& [key, pose] : last) EXPECT_EQ(solution.poses.at(key).position_m, pose.position_m);
}

}  // namespace
}  // namespace moondb
