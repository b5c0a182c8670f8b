// Tests priors (absolute measurements of nodes) in the solver.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "actors/pgo/pose_graph_solver.h"
#include "tests/actors/pgo/scenario_test.h"

namespace moondb {
namespace {

using simulation::MakeScenario;
using simulation::PriorOf;
using testing::HasSubstr;

class PriorsTest : public simulation::ScenarioTest {
 protected:
  PriorsTest() { rng_.seed(5); }

  void SetUp() override {
    scenario_ = MakeScenario({.seed = 3, .yaw_noise_rad = 0.01});
    scenario_.graph.ranges.clear();
  }

  NodePrior& Add(const NodeKey& node, PriorExtent extent, const std::string& source = "gnss") {
    scenario_.graph.priors.push_back(PriorOf(scenario_, node, extent, source, rng_));
    return scenario_.graph.priors.back();
  }

  void AddEach(int every, PriorExtent extent) {
    for (const AgentId agent : {1, 2, 3}) {
      for (std::uint64_t i = 0; i < 100; i += static_cast<std::uint64_t>(every)) Add({agent, i}, extent);
    }
  }

  // Makes agent 2 a rover that does not know where it started.
  void LoseStart() {
    scenario_.agents.at(2).start.reset();
    for (GraphNode& node : scenario_.graph.nodes) {
      if (node.key.agent == 2) node.map_from_node = Pose::FromPlanar(300, 40, 1.5) * node.map_from_node;
    }
  }

  static FactorCount Priors(const Solution& solution) { return solution.CountOf(FactorKind::kPrior); }
};

TEST_F(PriorsTest, CorrectDrift) {
  for (const PriorExtent extent : {PriorExtent::kPosition, PriorExtent::kPositionYaw, PriorExtent::kPose}) {
    SCOPED_TRACE(static_cast<int>(extent));
    SetUp();
    AddEach(10, extent);
    const Solution solution = Solve();
    EXPECT_LT(ErrorM(solution), 0.15);
    EXPECT_EQ(Priors(solution).usable, 30u);
    EXPECT_LE(Priors(solution).rejected, 1u);
    EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAnchored);
  }
}

TEST_F(PriorsTest, OfAnAntennaBesideTheBodyMeasureTheBody) {
  for (const AgentId agent : {1, 2, 3}) {
    for (std::uint64_t i = 0; i < 100; i += 10) {
      NodePrior& prior = Add({agent, i}, PriorExtent::kPosition);
      prior.point_m = {-0.8, 0.4, 1.2};
      prior.map_from_node.position_m += scenario_.truth.at(prior.node).orientation * prior.point_m;
    }
  }
  EXPECT_LT(ErrorM(Solve()), 0.15);
}

TEST_F(PriorsTest, OneThirtyKilometresOffIsRejected) {
  AddEach(10, PriorExtent::kPosition);
  const double right_m = ErrorM(Solve());
  Add({1, 55}, PriorExtent::kPosition).map_from_node.position_m.x() += 30'000;
  const Solution solution = Solve();
  EXPECT_NEAR(ErrorM(solution), right_m, 0.01);
  for (const FactorVerdict& verdict : solution.verdicts) {
    EXPECT_NE(verdict.is_inlier, verdict.factor.from == (NodeKey{1, 55}));
  }
}

TEST_F(PriorsTest, PlaceARoverWithoutAStart) {
  LoseStart();
  Add({2, 40}, PriorExtent::kPositionYaw, "apriltag");
  const Solution by_one = Solve();
  EXPECT_EQ(by_one.rovers[1].anchoring, Anchoring::kAnchored);
  EXPECT_LT(ErrorM(by_one), 2);
}

TEST_F(PriorsTest, TwoPositionsPlaceARoverAndOneDoesNotTurnIt) {
  LoseStart();
  Add({2, 10}, PriorExtent::kPosition);
  const Solution by_one = Solve();
  EXPECT_EQ(by_one.rovers[1].anchoring, Anchoring::kUnanchored);
  EXPECT_THAT(by_one.rovers[1].text, HasSubstr("its position priors do not determine its heading"));
  Add({2, 60}, PriorExtent::kPosition);
  Add({2, 90}, PriorExtent::kPosition);
  const Solution solution = Solve();
  EXPECT_EQ(solution.rovers[1].anchoring, Anchoring::kAnchored);
  EXPECT_LT(ErrorM(solution), 2);
}

TEST_F(PriorsTest, WarmSolvesKeepTheirVerdicts) {
  AddEach(10, PriorExtent::kPosition);
  Add({1, 55}, PriorExtent::kPosition).map_from_node.position_m.x() += 7;
  const Solution solution = Solve();
  const Solution again = Solve(ToLast(solution));
  EXPECT_EQ(Priors(again).rejected, Priors(solution).rejected);
  for (const auto& [node, pose] : again.poses) {
    EXPECT_LT((pose.position_m - solution.poses.at(node).position_m).norm(), 0.01) << ToString(node);
  }
}

}  // namespace
}  // namespace moondb
