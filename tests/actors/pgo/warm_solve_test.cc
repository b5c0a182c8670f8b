// Tests solves that start from an earlier solution: which poses stay, which may move, and how the solver recovers from
// a wrong solution.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "actors/pgo/pose_graph_solver.h"
#include "model/metrics.h"
#include "tests/actors/pgo/scenario.h"

namespace moondb {
namespace {

using simulation::MakeScenario;
using simulation::Scenario;
using simulation::TrajectoryErrorM;

constexpr std::int64_t kWarmStep_ns = 10'000'000'000;

// Returns the scenario as it was when each rover had `node_count` nodes.
Scenario Earlier(Scenario scenario, int node_count) {
  const auto is_late = [node_count](const auto& item) { return item.timestamp_ns >= node_count * kWarmStep_ns; };
  std::erase_if(scenario.graph.nodes, is_late);
  std::erase_if(scenario.graph.odometry, is_late);
  std::erase_if(scenario.graph.ranges, is_late);
  return scenario;
}

// Removes the rover's configured start and transforms its raw poses to another frame.
void ForgetStart(Scenario& scenario, AgentId agent) {
  scenario.agents.at(agent).start.reset();
  const Pose elsewhere = Pose::FromPlanar(50, -70.0 * agent, 2 * agent);
  for (GraphNode& node : scenario.graph.nodes) {
    if (node.key.agent == agent) node.map_from_node = elsewhere * node.map_from_node;
  }
}

double LargestMoveM(const std::map<NodeKey, Pose>& before, const std::map<NodeKey, Pose>& after) {
  double move_m = 0;
  for (const auto& [key, pose] : before) {
    move_m = std::max(move_m, (pose.position_m - after.at(key).position_m).norm());
  }
  return move_m;
}

class WarmSolveTest : public testing::Test {
 protected:
  WarmSolveTest() { options_.thread_count = 1; }

  Solution Solve(const Scenario& scenario, const LastSolution& last = {}) {
    return SolvePoseGraph(scenario.graph, scenario.agents, last, options_);
  }

  SolverOptions options_;
};

// Rover 1 drives 19 m along x, then turns left. Rover 2 stands at (10, 7), but its start is unknown. Only ranges after
// the turn distinguish left from right.
class MirrorTest : public WarmSolveTest {
 protected:
  void SetUp() override {
    scenario_.agents = {{1, AgentFacts{.agent = 1, .start = Pose{}}},
                        {2, AgentFacts{.agent = 2, .start = std::nullopt}}};
  }

  void Drive(std::uint64_t first, std::uint64_t end) {
    for (std::uint64_t i = first; i < end; ++i) {
      const Pose truth = i < 20 ? Pose::FromPlanar(1.0 * i, 0, 0) : Pose::FromPlanar(19, 1.0 * i - 19, M_PI / 2);
      const double range_m = (truth.position_m - Eigen::Vector3d(10, 7, 0)).norm();
      AddStep(1, i, truth, i == 20 ? Pose::FromPlanar(0, 1, M_PI / 2) : Pose::FromPlanar(1, 0, 0));
      AddStep(2, i, Pose{}, Pose{});
      scenario_.graph.ranges.push_back(RangeEdge{{1, i}, {2, i}, TimestampOf(i), range_m, 0.01});
    }
  }

  Scenario scenario_;

 private:
  static std::int64_t TimestampOf(std::uint64_t node) { return static_cast<std::int64_t>(node) * kWarmStep_ns; }

  void AddStep(AgentId agent, std::uint64_t to, const Pose& raw, const Pose& step) {
    scenario_.graph.nodes.push_back(GraphNode{{agent, to}, TimestampOf(to), raw});
    if (to == 0) return;
    scenario_.graph.odometry.push_back(
        OdometryEdge{{agent, to - 1}, {agent, to}, TimestampOf(to), step, 1e-4 * Matrix6d::Identity()});
  }
};

TEST_F(MirrorTest, StaysAmbiguousAndInPlaceWhileNoRangeDistinguishesTheSides) {
  Drive(0, 20);
  const Solution first = Solve(scenario_);
  const Solution second = Solve(scenario_, ToLast(first));
  ASSERT_TRUE(second.is_accepted) << second.text;
  EXPECT_EQ(second.rovers[1].anchoring, Anchoring::kAmbiguous);
  EXPECT_LT(LargestMoveM(first.poses, second.poses), 0.01);
}

TEST_F(MirrorTest, ChangesSidesWhenRangesDistinguishThem) {
  Drive(0, 20);
  const Solution first = Solve(scenario_);
  Drive(20, 24);
  for (const double side : {1, -1}) {
    LastSolution last = ToLast(first);
    for (auto& [key, pose] : last.poses) {
      if (key.agent == 2) pose.position_m.y() = side * std::abs(pose.position_m.y());
    }
    const Solution second = Solve(scenario_, last);
    ASSERT_TRUE(second.is_accepted) << second.text;
    EXPECT_LT((second.poses.at({2, 0}).position_m - Eigen::Vector3d(10, 7, 0)).norm(), 0.5);
    EXPECT_EQ(second.rovers[1].anchoring, Anchoring::kAnchored);
    EXPECT_EQ(second.CountOf(FactorKind::kRange).rejected, 0u);
  }
}

TEST_F(WarmSolveTest, DoesNotMoveAnArrangedRover) {
  Scenario scenario = MakeScenario({.seed = 1, .is_around_base = true});
  ForgetStart(scenario, 2);
  ForgetStart(scenario, 3);
  const Solution first = Solve(scenario);
  const Solution second = Solve(scenario, ToLast(first));
  ASSERT_TRUE(second.is_accepted) << second.text;
  EXPECT_LT(LargestMoveM(first.poses, second.poses), 0.01);
  EXPECT_THAT(second.rovers[1].text, testing::HasSubstr("its ranges determine where it is"));
}

TEST_F(WarmSolveTest, CorrectsARoverThatDriftedWithoutRanges) {
  constexpr int kBack = 85;
  Scenario scenario = MakeScenario({.seed = 31});
  std::erase_if(scenario.graph.ranges, [](const RangeEdge& edge) {
    return edge.from.agent == 1 && edge.from.index >= 50 && edge.from.index < kBack;
  });
  for (OdometryEdge& edge : scenario.graph.odometry) {
    if (edge.to.agent != 1 || edge.to.index < 50 || edge.to.index >= kBack) continue;
    edge.from_from_to.orientation = edge.from_from_to.orientation * Pose::FromPlanar(0, 0, 0.004).orientation;
  }
  const Solution last = Solve(Earlier(scenario, kBack));
  const Solution solution = Solve(scenario, ToLast(last));
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.initial_values, SolveInitialValues::kLastSolution);
  EXPECT_EQ(solution.CountOf(FactorKind::kRange).rejected, 0u);
  EXPECT_LT(LargestMoveM(Solve(scenario).poses, solution.poses), 0.1);
}

// The last solution is random. The solver rejects each result that starts from the last solution, and accepts a result
// that starts from odometry.
TEST_F(WarmSolveTest, RecoversFromAnUnusableLastSolution) {
  const Scenario scenario = MakeScenario({.seed = 32, .node_count = 60});
  std::mt19937_64 rng(32);
  std::uniform_real_distribution<double> anywhere(-1000, 1000);
  LastSolution last;
  for (const GraphNode& node : scenario.graph.nodes) {
    last.poses[node.key] = Pose{{anywhere(rng), anywhere(rng), anywhere(rng)}, Eigen::Quaterniond::Identity()};
  }
  options_.iterations_max = 12;
  const Solution solution = Solve(scenario, last);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_EQ(solution.initial_values, SolveInitialValues::kOdometry);
  EXPECT_LT(TrajectoryErrorM(scenario, solution.poses), 0.5);
}

TEST_F(WarmSolveTest, RecoversFromARoverOnTheWrongSide) {
  const Scenario scenario = MakeScenario({.seed = 33, .node_count = 60, .is_around_base = true});
  const Solution cold = Solve(scenario);
  LastSolution last = ToLast(cold);
  const Pose away = Pose::FromPlanar(30, -20, 2);
  for (auto& [key, pose] : last.poses) {
    if (key.agent == 2) pose = away * pose;
  }
  for (const RangeEdge& edge : scenario.graph.ranges) {
    if (edge.from.agent == 2 || edge.to.agent == 2) last.rejected.insert(KeyOf(edge));
  }
  const Solution solution = Solve(scenario, last);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_LT(LargestMoveM(cold.poses, solution.poses), 0.1);
}

TEST_F(WarmSolveTest, DoesNotRotateATeamThatMayRotateAboutTheBaseStation) {
  Scenario scenario = MakeScenario({.seed = 34, .is_around_base = true});
  for (const AgentId agent : {1, 2, 3}) ForgetStart(scenario, agent);
  const Scenario earlier = Earlier(scenario, 90);
  const Solution first = Solve(earlier);
  const Solution second = Solve(scenario, ToLast(first));
  ASSERT_TRUE(second.is_accepted) << second.text;
  EXPECT_EQ(second.rovers[0].anchoring, Anchoring::kYawFree);
  EXPECT_LT(std::abs(FindAlignment(second.poses, first.poses, /*is_planar=*/true).Yaw()), 0.002);
  // Another solve without new records moves nothing.
  EXPECT_LT(LargestMoveM(second.poses, Solve(scenario, ToLast(second)).poses), 0.01);
}

TEST_F(WarmSolveTest, DoesNotMoveTheTeamThoughSlightlyBetterPlacementsExist) {
  Scenario scenario = MakeScenario({.seed = 35, .start_sigma_m = 0.3, .is_around_base = true});
  const Solution solved = Solve(scenario);
  // In the last solution, the whole team is turned by 0.004 rad around the base station. That is well within the
  // uncertainty of the configured starts.
  LastSolution last = ToLast(solved);
  const Pose base = scenario.agents.at(4).start.value();
  const Pose turn = base * Pose::FromPlanar(0, 0, 0.004) * base.Inverse();
  for (auto& [key, pose] : last.poses) {
    if (key.agent != 4) pose = turn * pose;
  }
  const Solution again = Solve(scenario, last);
  ASSERT_TRUE(again.is_accepted) << again.text;
  EXPECT_LT(std::abs(FindAlignment(again.poses, last.poses, /*is_planar=*/true).Yaw()), 1e-3);
}

TEST_F(WarmSolveTest, RepeatedSolvesEndNearASingleSolve) {
  for (const std::uint64_t seed : {38, 39, 40, 41}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scenario scenario = MakeScenario({.seed = seed, .outlier_ratio = 0.05, .is_around_base = true});
    LastSolution last;
    for (int node_count = 10; node_count <= 100; node_count += 5) {
      const Solution solution = Solve(Earlier(scenario, node_count), last);
      ASSERT_TRUE(solution.is_accepted) << solution.text;
      last = ToLast(solution);
    }
    const double at_once_m = TrajectoryErrorM(scenario, Solve(scenario).poses);
    EXPECT_LT(TrajectoryErrorM(scenario, last.poses), 1.2 * at_once_m + 0.05);
  }
}

TEST_F(WarmSolveTest, AWindowIncludesAllNodesThatWereNeverSolved) {
  const Scenario scenario = MakeScenario({.seed = 36});
  const Solution full = Solve(scenario);
  LastSolution last = ToLast(full);
  for (std::uint64_t i = 30; i < 40; ++i) last.poses.erase({1, i});
  options_.window_nodes = 10;
  const Solution never = Solve(scenario);
  EXPECT_EQ(never.verdicts.size(), full.verdicts.size());
  EXPECT_LT(LargestMoveM(full.poses, never.poses), 1e-6);
  const Solution partly = Solve(scenario, last);
  ASSERT_TRUE(partly.is_accepted) << partly.text;
  EXPECT_LT(LargestMoveM(full.poses, partly.poses), 0.02);
}

TEST_F(WarmSolveTest, CountsFixedNodesNeitherAsKnownNorAsNew) {
  Scenario scenario = MakeScenario({.seed = 37, .node_count = 20});
  const Pose base = scenario.agents.at(4).start.value();
  for (std::uint64_t i = 1; i < 100; ++i) scenario.graph.nodes.push_back(GraphNode{{4, i}, 0, base});
  const Solution first = Solve(scenario);
  EXPECT_EQ(Solve(scenario, ToLast(first)).initial_values, SolveInitialValues::kLastSolution);
}

}  // namespace
}  // namespace moondb
