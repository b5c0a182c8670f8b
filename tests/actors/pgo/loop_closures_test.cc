// Tests loop closures in the solver: their effect, outlier tests, the test of sets, and rovers that they place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "actors/pgo/pose_graph_solver.h"
#include "tests/actors/pgo/scenario_test.h"

namespace moondb {
namespace {

using simulation::LoopClosureOf;
using simulation::MakeScenario;
using simulation::ScenarioOptions;
using testing::HasSubstr;
using testing::Not;

class LoopClosuresTest : public simulation::ScenarioTest {
 protected:
  void Use(const ScenarioOptions& options) {
    scenario_ = MakeScenario(options);
    rng_.seed(options.seed);
  }

  void UseWithoutRanges(std::uint64_t seed = 1) {
    Use({.seed = seed, .yaw_noise_rad = 0.01});
    scenario_.graph.ranges.clear();
  }

  void ForgetStart(AgentId agent) { scenario_.agents.at(agent).start.reset(); }

  // Moves a rover's raw poses, as of a rover that does not know where it started.
  void MoveRawPoses(AgentId agent, const Pose& by) {
    for (GraphNode& node : scenario_.graph.nodes) {
      if (node.key.agent == agent) node.map_from_node = by * node.map_from_node;
    }
  }

  void AddClosures(AgentId from, AgentId to, int every, const std::string& source = "apriltag",
                   const Eigen::Vector3d& offset_m = Eigen::Vector3d::Zero()) {
    for (std::uint64_t i = 5; i < 100; i += static_cast<std::uint64_t>(every)) {
      AddClosure({from, i}, {to, 99 - i}, source, offset_m);
    }
  }

  void AddClosure(const NodeKey& from, const NodeKey& to, const std::string& source = "apriltag",
                  const Eigen::Vector3d& offset_m = Eigen::Vector3d::Zero()) {
    scenario_.graph.closures.push_back(LoopClosureOf(scenario_, from, to, source, rng_, offset_m));
  }

  static FactorCount Closures(const Solution& solution) { return solution.CountOf(FactorKind::kLoopClosure); }

  static const RoverResult& Rover(const Solution& solution, AgentId agent) {
    for (const RoverResult& rover : solution.rovers) {
      if (rover.agent == agent) return rover;
    }
    ADD_FAILURE() << "no rover " << agent;
    return solution.rovers.front();
  }
};

TEST_F(LoopClosuresTest, CorrectDriftWithoutRanges) {
  UseWithoutRanges();
  const double odometry_m = ErrorM(Solve());
  AddClosures(1, 2, 5);
  AddClosures(2, 3, 5);
  AddClosures(1, 1, 7);
  const Solution solution = Solve();
  EXPECT_LT(ErrorM(solution), 0.5 * odometry_m);
  EXPECT_EQ(Closures(solution).usable, scenario_.graph.closures.size());
  EXPECT_LE(Closures(solution).rejected, 2u);
  EXPECT_EQ(Rover(solution, 2).anchoring, Anchoring::kAnchored);
}

TEST_F(LoopClosuresTest, OutlierTestsRejectRandomWrongOnes) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Use({.seed = seed});
    AddClosures(1, 2, 4);
    AddClosures(2, 3, 4);
    const double right_m = ErrorM(Solve());
    const std::size_t right_count = scenario_.graph.closures.size();
    std::uniform_real_distribution<double> offset(-5, 5);
    for (std::size_t i = 0; i < right_count * 3 / 2; ++i) {  // 60 % are wrong.
      const auto index = static_cast<std::uint64_t>(i * 2 % 100);
      const AgentId from = 1 + i % 2;
      AddClosure({from, index}, {from + 1, (index * 7 + 3) % 100}, "slam_toolbox",
                 {offset(rng_), offset(rng_), 1 + offset(rng_)});
    }
    const Solution solution = Solve();
    EXPECT_LT(ErrorM(solution), right_m + 0.05);
    std::size_t wrong_verdicts = 0;
    for (const FactorVerdict& verdict : solution.verdicts) {
      if (verdict.factor.kind != FactorKind::kLoopClosure) continue;
      wrong_verdicts += verdict.is_inlier != (verdict.factor.source == "apriltag");
    }
    EXPECT_LE(wrong_verdicts, scenario_.graph.closures.size() / 15);
  }
}

TEST_F(LoopClosuresTest, RangesRefuseASetThatIsWrongTogether) {
  Use({.seed = 4, .range_every = 8, .yaw_noise_rad = 0.01});
  const double without_m = ErrorM(Solve());
  AddClosures(1, 2, 3, "slam_toolbox", {0.7, 0.5, 0});
  const Solution solution = Solve();
  EXPECT_LT(ErrorM(solution), without_m + 1e-3);
  ASSERT_EQ(solution.refused.size(), 1u);
  EXPECT_EQ(solution.refused[0].source, "slam_toolbox");
  EXPECT_EQ(solution.refused[0].agents, std::pair(AgentId{1}, AgentId{2}));
  EXPECT_EQ(Closures(solution).rejected, Closures(solution).usable);

  // The next solve keeps the verdict. A corrected set is accepted again.
  EXPECT_EQ(Solve(ToLast(solution)).refused.size(), 1u);
  const LastSolution last = ToLast(solution);
  std::erase_if(scenario_.graph.closures, [](const LoopClosure& c) { return c.source == "slam_toolbox"; });
  AddClosures(1, 2, 3, "slam_toolbox");
  EXPECT_TRUE(Solve(last).refused.empty());
}

TEST_F(LoopClosuresTest, ASolveThatIsStoppedDuringTheTestOfSetsChangesNothing) {
  UseWithoutRanges();
  AddClosures(1, 2, 5);
  int polls = 0;
  SolverOptions options;
  options.thread_count = 1;
  options.stop_requested = [&polls] { return ++polls > 10'000; };
  ASSERT_TRUE(SolvePoseGraph(scenario_.graph, scenario_.agents, {}, options).is_accepted);
  const int all = std::exchange(polls, 0);
  options.stop_requested = [&polls, all] { return ++polls > all - 3; };
  const Solution stopped = SolvePoseGraph(scenario_.graph, scenario_.agents, {}, options);
  EXPECT_FALSE(stopped.is_accepted);
  EXPECT_TRUE(stopped.verdicts.empty());
}

TEST_F(LoopClosuresTest, ContradictingOnesAreNotAllAccepted) {
  UseWithoutRanges();
  AddClosure({1, 10}, {2, 90}, "apriltag");
  AddClosure({1, 10}, {2, 90}, "slam_toolbox", {3, 0, 0});
  const Solution solution = Solve();
  EXPECT_GE(Closures(solution).rejected, 1u);
  std::map<std::string, bool> is_inlier;
  for (const FactorVerdict& verdict : solution.verdicts) is_inlier[verdict.factor.source] = verdict.is_inlier;
  EXPECT_FALSE(is_inlier.at("slam_toolbox"));
}

TEST_F(LoopClosuresTest, NewOnesCorrectAWarmSolution) {
  UseWithoutRanges();
  const Solution before = Solve();
  AddClosures(1, 2, 5);
  AddClosures(2, 3, 5);
  const Solution cold = Solve();
  const Solution warm = Solve(ToLast(before));
  EXPECT_NEAR(ErrorM(warm), ErrorM(cold), 0.02);
  const Solution again = Solve(ToLast(warm));
  for (const auto& [node, pose] : again.poses) {
    EXPECT_LT((pose.position_m - warm.poses.at(node).position_m).norm(), 0.01) << ToString(node);
  }
}

TEST_F(LoopClosuresTest, TwoThatAgreePlaceARoverWithoutAStart) {
  UseWithoutRanges();
  ForgetStart(2);
  MoveRawPoses(2, Pose::FromPlanar(200, -80, 2));
  AddClosure({1, 20}, {2, 60});
  EXPECT_THAT(Rover(Solve(), 2).text, HasSubstr("not placed: one loop closure joins it to placed rovers"));
  AddClosure({1, 70}, {2, 30});
  const Solution solution = Solve();
  EXPECT_EQ(Rover(solution, 2).anchoring, Anchoring::kAnchored);
  EXPECT_THAT(Rover(solution, 2).text, Not(HasSubstr("not placed")));
  EXPECT_EQ(solution.initial_values, SolveInitialValues::kArrangedRovers);
  EXPECT_LT(ErrorM(solution), 3);
  // The next solve leaves the rover there.
  EXPECT_LT(ErrorM(Solve(ToLast(solution))), 3);
}

TEST_F(LoopClosuresTest, OneOrTwoThatDisagreePlaceNoRover) {
  UseWithoutRanges();
  ForgetStart(2);
  MoveRawPoses(2, Pose::FromPlanar(200, -80, 2));
  AddClosure({1, 20}, {2, 60});
  AddClosure({1, 70}, {2, 30}, "apriltag", {40, 0, 0});
  const Solution solution = Solve();
  EXPECT_EQ(Rover(solution, 2).anchoring, Anchoring::kUnanchored);
  EXPECT_THAT(Rover(solution, 2).text, HasSubstr("no two of its 2 loop closures to placed rovers agree"));
  EXPECT_EQ(Closures(solution).rejected, 2u);
}

TEST_F(LoopClosuresTest, PlaceRoversThroughOthers) {
  UseWithoutRanges();
  for (const AgentId agent : {2, 3}) {
    ForgetStart(agent);
    MoveRawPoses(agent, Pose::FromPlanar(-90 * agent, 70, agent));
  }
  AddClosures(2, 3, 10);
  AddClosures(1, 2, 10);
  const Solution solution = Solve();
  EXPECT_EQ(Rover(solution, 3).anchoring, Anchoring::kAnchored);
  EXPECT_LT(ErrorM(solution), 2);
}

TEST_F(LoopClosuresTest, WithoutAnyStartTheShapeOfTheTeamIsRight) {
  UseWithoutRanges();
  for (const AgentId agent : {1, 2, 3}) ForgetStart(agent);
  MoveRawPoses(2, Pose::FromPlanar(200, -80, 2));
  AddClosures(1, 2, 10);
  AddClosures(2, 3, 10);
  const Solution solution = Solve();
  EXPECT_EQ(Rover(solution, 2).anchoring, Anchoring::kUnanchored);
  const Pose measured = solution.poses.at({1, 50}).Inverse() * solution.poses.at({2, 50});
  const Pose truth = scenario_.truth.at({1, 50}).Inverse() * scenario_.truth.at({2, 50});
  EXPECT_LT((measured.position_m - truth.position_m).norm(), 1);
}

TEST_F(LoopClosuresTest, AWindowSolveUsesThem) {
  UseWithoutRanges();
  AddClosures(1, 2, 5);
  const Solution whole = Solve();
  SolverOptions options;
  options.thread_count = 1;
  options.window_nodes = 20;
  const Solution window = SolvePoseGraph(scenario_.graph, scenario_.agents, ToLast(whole), options);
  ASSERT_TRUE(window.is_accepted) << window.text;
  EXPECT_NEAR(ErrorM(window), ErrorM(whole), 0.05);
}

}  // namespace
}  // namespace moondb
