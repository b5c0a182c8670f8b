#include "actors/pgo/pose_graph_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
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

TEST_F(PoseGraphSolverTest, IsMoreAccurateThanOdometry) {
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

TEST_F(PoseGraphSolverTest, ReportsAConfiguredStartThatRangesContradict) {
  Scenario scenario = MakeScenario({.seed = 6});
  for (const RoverResult& rover : Solve(scenario).rovers) EXPECT_EQ(rover.text, "");
  scenario.agents.at(2).start->position_m.x() += 30;
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  ASSERT_GE(solution.rovers.size(), 2u);
  EXPECT_THAT(solution.rovers[1].text, testing::HasSubstr("ranges contradict the rest"));
}

TEST_F(PoseGraphSolverTest, FindsTheLongRanges) {
  for (const std::uint64_t seed : {4, 5}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.15});
    const Solution solution = Solve(scenario);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    ASSERT_EQ(solution.verdicts.size(), scenario.is_outlier.size());
    std::map<FactorKey, bool> is_outlier;
    for (std::size_t i = 0; i < scenario.is_outlier.size(); ++i) {
      is_outlier[KeyOf(scenario.graph.ranges[i])] = scenario.is_outlier[i];
    }
    std::size_t wrong = 0;
    for (const FactorVerdict& range : solution.verdicts) wrong += range.is_inlier == is_outlier.at(range.factor);
    EXPECT_LE(wrong, solution.verdicts.size() / 50);
    EXPECT_GT(solution.CountOf(FactorKind::kRange).rejected, 5u);
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

TEST_F(PoseGraphSolverTest, ScaleAntennasAndGravityImproveTheSolution) {
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

TEST_F(PoseGraphSolverTest, AbsorbsARangeBiasOfEachPair) {
  const Scenario scenario = MakeScenario({.seed = 8, .bias_sigma_m = 0.15});
  const double with_bias_m = TrajectoryErrorM(scenario, Solve(scenario).poses);
  options_.bias_sigma_m = 1e-6;
  EXPECT_LT(with_bias_m, TrajectoryErrorM(scenario, Solve(scenario).poses));
}

TEST_F(PoseGraphSolverTest, GivesTheSameSolutionInAnyOrderOfArrival) {
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

TEST_F(PoseGraphSolverTest, DoesNotMoveWhenSolvedAgain) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.15, .bias_sigma_m = 0.1});
    const Solution first = Solve(scenario);
    const Solution again = Solve(scenario, ToLast(first));
    ASSERT_TRUE(again.is_accepted) << again.text;
    EXPECT_EQ(again.CountOf(FactorKind::kRange).rejected, first.CountOf(FactorKind::kRange).rejected);
    for (const auto& [key, pose] : first.poses) {
      ASSERT_LT((pose.position_m - again.poses.at(key).position_m).norm(), 1e-4) << ToString(key);
    }
  }
}

TEST_F(PoseGraphSolverTest, MovesOnlyTheNewestNodesInAWindow) {
  const Scenario scenario = MakeScenario({.seed = 18, .scale_errors = {0.02, -0.02, 0.01}, .bias_sigma_m = 0.1});
  Scenario earlier = scenario;
  const auto is_late = [](const auto& item) { return item.timestamp_ns > 900'000'000'000; };
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
  EXPECT_LT(window.verdicts.size(), all.verdicts.size());
  for (AgentId agent = 1; agent <= 3; ++agent) {
    EXPECT_LT((window.poses.at({agent, 99}).position_m - all.poses.at({agent, 99}).position_m).norm(), 0.1);
  }
}

TEST_F(PoseGraphSolverTest, StartsFromTheLastSolution) {
  const ScenarioOptions options{.seed = 11, .scale_errors = {0.03, 0.03, 0.03}};
  const Scenario scenario = MakeScenario(options);
  // If the last solution covers half of the records, the next solve starts from odometry. If the last solution covers
  // nine tenths of the records, the next solve starts from that solution.
  for (const auto& [last_ns, initial_values] : {std::pair(500'000'000'000, SolveInitialValues::kOdometry),
                                                std::pair(900'000'000'000, SolveInitialValues::kLastSolution)}) {
    Scenario earlier = scenario;
    const auto is_late = [end_ns = last_ns](const auto& item) { return item.timestamp_ns > end_ns; };
    std::erase_if(earlier.graph.nodes, is_late);
    std::erase_if(earlier.graph.odometry, is_late);
    std::erase_if(earlier.graph.ranges, is_late);
    const Solution first = Solve(earlier);
    const Solution second = Solve(scenario, ToLast(first));
    ASSERT_TRUE(second.is_accepted) << second.text;
    EXPECT_EQ(second.initial_values, initial_values);
    EXPECT_GT(second.CountOf(FactorKind::kRange).usable, first.CountOf(FactorKind::kRange).usable);
    EXPECT_NEAR(second.final_cost, Solve(scenario).final_cost, 0.6) << "no rover moves as a whole for less";
  }
}

TEST_F(PoseGraphSolverTest, ReportsThatThereIsNothingToSolve) {
  const Solution nothing = SolvePoseGraph({}, {}, {}, options_);
  EXPECT_TRUE(nothing.is_accepted);
  EXPECT_EQ(nothing.text, "no rover has a node yet");
  EXPECT_TRUE(nothing.poses.empty());
}

TEST_F(PoseGraphSolverTest, KeepsASingleNodeAtItsStart) {
  PoseGraph graph;
  graph.nodes = {GraphNode{{1, 0}, 0, Pose::FromPlanar(3.2, 1, 0)}};
  const AgentFactsMap agents = {{1, AgentFacts{.agent = 1, .start = Pose::FromPlanar(3, 1, 0.5)}}};
  const Solution solution = SolvePoseGraph(graph, agents, {}, options_);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_LT((solution.poses.at({1, 0}).position_m - Eigen::Vector3d(3, 1, 0)).norm(), 1e-6);
  EXPECT_NEAR(solution.poses.at({1, 0}).Yaw(), 0.5, 1e-6);
}

TEST_F(PoseGraphSolverTest, FollowsOdometryWithoutRangesAndReportsIt) {
  Scenario scenario = MakeScenario({.seed = 12});
  scenario.graph.ranges.clear();
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  for (const RoverResult& rover : solution.rovers) {
    EXPECT_EQ(rover.anchoring, Anchoring::kNoRanges);
    EXPECT_NE(rover.text, "");
  }
}

TEST_F(PoseGraphSolverTest, ReportsARoverThatNothingConnectsToTheMap) {
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

TEST_F(PoseGraphSolverTest, AnchorsARoverWithoutAConfiguredStartByRanges) {
  Scenario scenario = MakeScenario({.seed = 14});
  scenario.agents.at(2).start.reset();
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAnchored);
  EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.4);
}

TEST_F(PoseGraphSolverTest, LeavesOutDamagedRecordsAndSolvesTheRest) {
  Scenario scenario = MakeScenario({.seed = 15});
  const double clean_m = TrajectoryErrorM(scenario, Solve(scenario).poses);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  scenario.graph.ranges.push_back(RangeEdge{{1, 4}, {2, 4}, 0, nan, 0.01});
  scenario.graph.ranges.push_back(RangeEdge{{1, 4}, {2, 4000}, 0, 3, 0.01});
  scenario.graph.odometry.push_back(OdometryEdge{{1, 4}, {1, 5}, 0, {}, Matrix6d::Constant(nan)});
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.left_out.at(1).count, 3u);
  EXPECT_THAT(solution.rovers[0].text, testing::StartsWith("3 records excluded, first: odometry from agent 1, node 4"));
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

TEST_F(PoseGraphSolverTest, AFixedScaleStaysOne) {
  Scenario scenario = MakeScenario({.seed = 19, .scale_errors = {0.03, 0.03, 0.03}});
  scenario.agents.at(2).has_fixed_scale = true;
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[1].odometry_scale, 1);
  EXPECT_GT(solution.rovers[0].odometry_scale, 1.01);
  options_.covariance_of = {{2, 50}};
  EXPECT_EQ(Solve(scenario, ToLast(solution)).covariances.size(), 1u);
}

TEST_F(PoseGraphSolverTest, KeepsTheOldPosesWhenStopped) {
  const Scenario scenario = MakeScenario({.seed = 17, .node_count = 20});
  options_.stop_requested = [] { return true; };
  std::map<NodeKey, Pose> last = PosesOf(scenario.graph);
  const Solution solution = Solve(scenario, {.poses = last, .rejected = {}, .accepted = {}});
  EXPECT_FALSE(solution.is_accepted);
  EXPECT_NE(solution.text, "");
  EXPECT_TRUE(solution.verdicts.empty());
  EXPECT_TRUE(solution.rovers.empty()) << "nothing was determined of them";
  for (const auto& [key, pose] : last) EXPECT_EQ(solution.poses.at(key).position_m, pose.position_m);
}

TEST_F(PoseGraphSolverTest, CovariancesMatchTheErrors) {
  constexpr int kDraws = 60;
  const std::vector<NodeKey> nodes = {{1, 39}, {2, 20}};
  options_.covariance_of = nodes;
  double square_sum = 0;
  for (int seed = 1; seed <= kDraws; ++seed) {
    const Scenario scenario =
        MakeScenario({.seed = static_cast<std::uint64_t>(seed), .node_count = 40, .is_around_base = true});
    const Solution solution = Solve(scenario);
    ASSERT_EQ(solution.covariances.size(), nodes.size());
    for (const NodeKey& node : nodes) {
      const Eigen::Vector3d error_m = solution.poses.at(node).position_m - scenario.truth.at(node).position_m;
      const Eigen::Matrix3d covariance = solution.covariances.at(node).topLeftCorner<3, 3>();
      square_sum += error_m.dot(covariance.inverse() * error_m);
    }
  }
  // If the covariances match the errors, the expected sum is 3 per node and draw.
  const double mean = square_sum / (kDraws * 2);
  EXPECT_GT(mean, 2.4);
  EXPECT_LT(mean, 3.6);
}

TEST_F(PoseGraphSolverTest, OmitsCovariancesThatAreUnknown) {
  Scenario scenario = MakeScenario({.seed = 24});
  scenario.agents.at(3).start.reset();
  std::erase_if(scenario.graph.ranges,
                [](const RangeEdge& edge) { return edge.from.agent == 3 || edge.to.agent == 3; });
  options_.covariance_of = {{1, 10}, {1, 99}, {3, 99}, {4, 0}};
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_THAT(solution.covariances, testing::SizeIs(2));
  EXPECT_TRUE(solution.covariances.contains({1, 10})) << "a rover's node";
  EXPECT_FALSE(solution.covariances.contains({3, 99})) << "a rover that nothing ties to the map";
  EXPECT_FALSE(solution.covariances.contains({4, 0})) << "the base station stands";

  options_.window_nodes = 20;
  const Solution window = Solve(scenario, ToLast(solution));
  ASSERT_TRUE(window.is_accepted) << window.text;
  ASSERT_THAT(window.covariances, testing::SizeIs(2));
  for (const auto& [node, covariance] : solution.covariances) {
    EXPECT_NEAR(window.covariances.at(node)(0, 0), covariance(0, 0), 0.1 * covariance(0, 0)) << "as if all had moved";
  }
}

TEST_F(PoseGraphSolverTest, ArrangesATeamWithoutBaseStationAndKnownStarts) {
  Scenario scenario = MakeScenario({.seed = 25, .has_base_station = false, .is_around_base = true});
  for (auto& [agent, facts] : scenario.agents) {
    facts.start.reset();
    const Pose elsewhere = Pose::FromPlanar(50, -70.0 * agent, 2 * agent);
    for (GraphNode& node : scenario.graph.nodes) {
      if (node.key.agent == agent) node.map_from_node = elsewhere * node.map_from_node;
    }
  }
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  const Pose truth_from_map = FindAlignment(solution.poses, scenario.truth, /*is_planar=*/true);
  for (const auto& [key, truth] : scenario.truth) {
    const Eigen::Vector3d error_m = truth_from_map * solution.poses.at(key).position_m - truth.position_m;
    ASSERT_LT(error_m.head<2>().norm(), 1) << ToString(key);
  }
  for (const RoverResult& rover : solution.rovers) EXPECT_EQ(rover.anchoring, Anchoring::kUnanchored);
}

TEST_F(PoseGraphSolverTest, DoesNotCountARangeToARoverThatNothingConnectsToTheMap) {
  Scenario scenario = MakeScenario({.seed = 26, .rover_count = 2, .node_count = 20, .has_base_station = false});
  scenario.agents.at(2).start.reset();
  scenario.graph.ranges.resize(1);
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[0].anchoring, Anchoring::kNoRanges);
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kUnanchored);
}

// A rover drives over a hill. From node to node the slope changes by less than the noise of a step.
TEST_F(PoseGraphSolverTest, FollowsAHillGentlerThanTheNoiseOfAStep) {
  constexpr double kTiltNoise_rad = 0.002;
  constexpr double kWave = 2 * M_PI / 200;
  std::mt19937_64 rng(27);
  std::normal_distribution<double> noise(0, kTiltNoise_rad);
  const auto truth_at = [](std::uint64_t i) {
    const double x = 0.3 * static_cast<double>(i);
    const double slope = std::atan(5 * kWave * std::cos(kWave * x));
    return Pose{{x, 0, 5 * std::sin(kWave * x)},
                Eigen::Quaterniond(Eigen::AngleAxisd(-slope, Eigen::Vector3d::UnitY()))};
  };
  Scenario scenario;
  scenario.agents[1] = AgentFacts{.agent = 1, .start = Pose{}};
  Pose raw = truth_at(0);
  for (std::uint64_t i = 0; i < 600; ++i) {
    if (i > 0) {
      OdometryEdge edge{{1, i - 1}, {1, i}, 0, truth_at(i - 1).Inverse() * truth_at(i), 1e-4 * Matrix6d::Identity()};
      edge.covariance.bottomRightCorner<3, 3>() = kTiltNoise_rad * kTiltNoise_rad * Eigen::Matrix3d::Identity();
      edge.from_from_to.orientation =
          edge.from_from_to.orientation * Eigen::Quaterniond(1, noise(rng) / 2, noise(rng) / 2, 0).normalized();
      raw = raw * edge.from_from_to;
      scenario.graph.odometry.push_back(edge);
    }
    scenario.graph.nodes.push_back(GraphNode{{1, i}, 0, raw});
  }
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  double error_sum_rad = 0;
  for (std::uint64_t i = 0; i < 600; ++i) {
    const Eigen::Vector3d up = solution.poses.at({1, i}).orientation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d true_up = truth_at(i).orientation * Eigen::Vector3d::UnitZ();
    error_sum_rad += (up - true_up).norm();
  }
  EXPECT_LT(error_sum_rad / 600, 0.06) << "level ground would be wrong by 0.1 rad";
}

TEST_F(PoseGraphSolverTest, PlacesRoversWithUnknownStarts) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.05, .is_around_base = true});
    for (const AgentId agent : {AgentId{2}, AgentId{3}}) {
      scenario.agents.at(agent).start.reset();
      const Pose elsewhere = Pose::FromPlanar(50, -70.0 * agent, 2 * agent);
      for (GraphNode& node : scenario.graph.nodes) {
        if (node.key.agent == agent) node.map_from_node = elsewhere * node.map_from_node;
      }
    }
    const Solution solution = Solve(scenario);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    EXPECT_EQ(solution.initial_values, SolveInitialValues::kArrangedRovers);
    EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 1);
    EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAnchored);
  }
}

TEST_F(PoseGraphSolverTest, ReportsThatARoverMayBeOnEitherSideOfALine) {
  // Rover 1 drives along x and ranges rover 2, which stands still. No measurement distinguishes left from right.
  PoseGraph graph;
  for (std::uint64_t i = 0; i < 20; ++i) {
    graph.nodes.push_back(GraphNode{{1, i}, static_cast<std::int64_t>(i), Pose::FromPlanar(1.0 * i, 0, 0)});
    graph.nodes.push_back(GraphNode{{2, i}, static_cast<std::int64_t>(i), Pose{}});
    graph.ranges.push_back(
        RangeEdge{{1, i}, {2, i}, static_cast<std::int64_t>(i), std::hypot(10.0 - static_cast<double>(i), 7), 0.01});
    if (i == 0) continue;
    const auto add = [&](AgentId agent, double x) {
      graph.odometry.push_back(OdometryEdge{{agent, i - 1},
                                            {agent, i},
                                            static_cast<std::int64_t>(i),
                                            Pose::FromPlanar(x, 0, 0),
                                            1e-4 * Matrix6d::Identity()});
    };
    add(1, 1);
    add(2, 0);
  }
  const AgentFactsMap agents = {{1, AgentFacts{.agent = 1, .start = Pose{}}},
                                {2, AgentFacts{.agent = 2, .start = std::nullopt}}};
  const Solution solution = SolvePoseGraph(graph, agents, {}, options_);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[0].anchoring, Anchoring::kAnchored);
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAmbiguous);
  EXPECT_THAT(solution.rovers[1].text, testing::HasSubstr("ambiguous"));
  EXPECT_NEAR(std::abs(solution.poses.at({2, 5}).position_m.y()), 7, 0.5);
}

TEST_F(PoseGraphSolverTest, ReportsThatATeamWithoutStartsMayRotateAboutTheBaseStation) {
  Scenario scenario = MakeScenario({.seed = 19, .is_around_base = true});
  for (auto& [agent, facts] : scenario.agents) {
    if (!facts.is_base_station) facts.start.reset();
  }
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  for (const RoverResult& rover : solution.rovers) {
    EXPECT_EQ(rover.anchoring, Anchoring::kYawFree);
    EXPECT_THAT(rover.text, testing::HasSubstr("rotation about the base station"));
  }
}

// A kind of damage to the graph. The solver must skip only the damaged record, name the record in rover 1's text, and
// return the same poses as without the damage.
struct Damage {
  const char* name;
  std::function<void(PoseGraph&)> add;
  const char* text;  // Text that Solution::rovers[0].text must contain.
};

class PoseGraphSolverDamageTest : public PoseGraphSolverTest, public testing::WithParamInterface<Damage> {};

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

void AddRange(PoseGraph& graph, const NodeKey& to, double range_m, double variance_m2) {
  graph.ranges.push_back(RangeEdge{{1, 4}, to, 0, range_m, variance_m2});
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, PoseGraphSolverDamageTest,
    testing::Values(
        Damage{"NaNRange",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, kNaN, 0.01);
               },
               "is not a distance"},
        Damage{"InfiniteRange",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, kInfinity, 0.01);
               },
               "is not a distance"},
        Damage{"NegativeRange",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, -1, 0.01);
               },
               "is not a distance"},
        Damage{"RangeBeyondAnyRadio",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 1e9, 0.01);
               },
               "is not a distance"},
        Damage{"VarianceNextToNothing",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 3, 1e-20);
               },
               "variance is not between"},
        Damage{"VarianceBelowAllNumbers",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 3, 1e-320);
               },
               "variance is not between"},
        Damage{"CovarianceNextToNothing",
               [](PoseGraph& g) {
                 g.odometry.push_back(OdometryEdge{{1, 4}, {1, 5}, 0, {}, 1e-20 * Matrix6d::Identity()});
               },
               "variances are not between"},
        Damage{"ZeroVariance",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 3, 0);
               },
               "variance is not between"},
        Damage{"NegativeVariance",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 3, -1);
               },
               "variance is not between"},
        Damage{"NaNVariance",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4}, 3, kNaN);
               },
               "variance is not between"},
        Damage{"RangeWithItself",
               [](PoseGraph& g) {
                 AddRange(g, {1, 4}, 3, 0.01);
               },
               "two nodes of one agent"},
        Damage{"UnknownNode",
               [](PoseGraph& g) {
                 AddRange(g, {2, 4000}, 3, 0.01);
               },
               "has no node record"},
        Damage{
            "NaNStep",
            [](PoseGraph& g) {
              g.odometry.push_back(OdometryEdge{{1, 4}, {1, 5}, 0, Pose::FromPlanar(kNaN, 0, 0), Matrix6d::Identity()});
            },
            "pose is not finite"},
        Damage{"NegativeCovariance",
               [](PoseGraph& g) {
                 g.odometry.push_back(OdometryEdge{{1, 4}, {1, 5}, 0, {}, -Matrix6d::Identity()});
               },
               "not symmetric and positive definite"},
        Damage{"NaNNode",
               [](PoseGraph& g) {
                 g.nodes.push_back(GraphNode{{1, 5000}, 0, Pose::FromPlanar(kNaN, 0, 0)});
               },
               "pose is not finite"},
        Damage{"DoubledNode",
               [](PoseGraph& g) {
                 g.nodes.insert(g.nodes.begin(), GraphNode{{1, 4}, 1'000'000'000'000, Pose::FromPlanar(900, 9, 1)});
               },
               "agent 1, node 4: occurs more than once"},
        Damage{"DoubledRange",
               [](PoseGraph& g) {
                 g.ranges.insert(g.ranges.begin(), RangeEdge{{1, 4}, {2, 4}, 1'000'000'000'000, 900, 0.01});
               },
               "range from agent 1, node 4 to agent 2, node 4: occurs more than once"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(PoseGraphSolverDamageTest, DamageIsNamedAndDoesNotChangeTheRest) {
  Scenario scenario = MakeScenario({.seed = 20, .node_count = 40});
  const Solution clean = Solve(scenario);
  GetParam().add(scenario.graph);
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_THAT(solution.rovers[0].text, testing::HasSubstr(GetParam().text));
  for (const auto& [key, pose] : clean.poses) {
    ASSERT_LT((pose.position_m - solution.poses.at(key).position_m).norm(), 1e-6) << ToString(key);
  }
}

TEST_F(PoseGraphSolverTest, SolvesEachDisconnectedPart) {
  Scenario scenario = MakeScenario({.seed = 21});
  std::erase_if(scenario.graph.ranges,
                [](const RangeEdge& edge) { return edge.from.agent == 3 || edge.to.agent == 3; });
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.rovers[0].anchoring, Anchoring::kAnchored);
  EXPECT_EQ(solution.rovers[2].anchoring, Anchoring::kNoRanges);
  EXPECT_EQ(solution.rovers[2].text, "no accepted range: only its start pose and odometry determine its poses");
}

TEST_F(PoseGraphSolverTest, SolvesATeamWithoutRanges) {
  Scenario scenario = MakeScenario({.seed = 22});
  scenario.graph.ranges.clear();
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  for (const RoverResult& rover : solution.rovers) EXPECT_EQ(rover.anchoring, Anchoring::kNoRanges);
}

TEST_F(PoseGraphSolverTest, SolvesThoughAntennasCoincide) {
  Scenario scenario = MakeScenario({.seed = 23, .node_count = 40});
  scenario.agents.at(2).start = scenario.agents.at(1).start;
  for (GraphNode& node : scenario.graph.nodes) {
    if (node.key == NodeKey{2, 0}) node.map_from_node = *scenario.agents.at(1).start;
  }
  std::erase_if(scenario.graph.ranges,
                [](const RangeEdge& edge) { return edge.from.agent == 2 || edge.to.agent == 2; });
  scenario.graph.ranges.push_back(RangeEdge{{1, 0}, {2, 0}, 0, 0, 0.01});
  const Solution solution = Solve(scenario);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  for (const auto& [key, pose] : solution.poses) ASSERT_TRUE(pose.position_m.allFinite()) << ToString(key);
}

TEST_F(PoseGraphSolverTest, SolvesATeamOnOneLine) {
  PoseGraph graph;
  AgentFactsMap agents = {{9, AgentFacts{.agent = 9, .is_base_station = true, .start = Pose{}}}};
  for (const AgentId agent : {AgentId{1}, AgentId{2}}) {
    agents[agent] = AgentFacts{.agent = agent, .start = Pose::FromPlanar(5.0 * agent, 0, 0)};
    for (std::uint64_t i = 0; i < 20; ++i) {
      const double x = 5.0 * agent + static_cast<double>(i);
      graph.nodes.push_back(GraphNode{{agent, i}, static_cast<std::int64_t>(i), Pose::FromPlanar(x, 0, 0)});
      graph.ranges.push_back(RangeEdge{{agent, i}, {9, 0}, static_cast<std::int64_t>(i), x, 0.01});
      if (i == 0) continue;
      graph.odometry.push_back(OdometryEdge{{agent, i - 1},
                                            {agent, i},
                                            static_cast<std::int64_t>(i),
                                            Pose::FromPlanar(1, 0, 0),
                                            1e-4 * Matrix6d::Identity()});
    }
  }
  const Solution solution = SolvePoseGraph(graph, agents, {}, options_);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_LT((solution.poses.at({2, 19}).position_m - Eigen::Vector3d(29, 0, 0)).norm(), 0.01);
}

}  // namespace
}  // namespace moondb
