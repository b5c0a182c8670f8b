#include "actors/pgo/unknown_starts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/actors/pgo/scenario.h"

namespace moondb {
namespace {

using simulation::MakeScenario;
using simulation::Scenario;
using simulation::ScenarioOptions;

class UnknownStartsTest : public testing::Test {
 protected:
  void Use(const ScenarioOptions& options) {
    scenario_ = MakeScenario(options);
    Prepare();
  }

  void ForgetStarts(const std::vector<AgentId>& agents) {
    for (const AgentId agent : agents) scenario_.agents.at(agent).start.reset();
    Prepare();
  }

  void Prepare(const std::map<NodeKey, Pose>& last = {}) {
    checked_ = CheckGraph(scenario_.graph, scenario_.agents);
    rovers_ = FindRovers(checked_);
    starts_.clear();
    for (const Rover& rover : rovers_) {
      starts_.push_back(FindStartPrior(checked_.nodes[rover.first], scenario_.agents, {}));
    }
    initial_ = FindInitialValues(checked_, rovers_, starts_, last);
  }

  std::vector<std::size_t> Unknown() { return FindUnknownRovers(checked_, rovers_, starts_); }

  std::vector<InitialValues> Arrange() {
    return ArrangeUnknownRovers(checked_, rovers_, starts_, Unknown(), scenario_.agents, initial_, {});
  }

  double ErrorM(const InitialValues& initial, const NodeKey& node) {
    return (initial.poses[*checked_.Find(node)].position_m - scenario_.truth.at(node).position_m).norm();
  }

  // Moves the rover's whole trajectory by the rigid motion `by`.
  static void MoveRover(AgentId agent, const Pose& by, std::map<NodeKey, Pose>& poses) {
    for (auto& [key, pose] : poses) {
      if (key.agent == agent) pose = by * pose;
    }
  }

  Scenario scenario_;
  CheckedGraph checked_;
  std::vector<Rover> rovers_;
  std::vector<StartPrior> starts_;
  InitialValues initial_;
};

TEST_F(UnknownStartsTest, FindsRoversWithoutAStartThatRangesConnect) {
  Use({.seed = 1, .node_count = 20});
  EXPECT_TRUE(Unknown().empty());
  std::erase_if(scenario_.graph.ranges, [](const RangeEdge& r) { return r.from.agent == 3 || r.to.agent == 3; });
  ForgetStarts({2, 3});
  EXPECT_THAT(Unknown(), testing::ElementsAre(1)) << "rover 3 has no range";
  Prepare(scenario_.truth);
  EXPECT_THAT(Unknown(), testing::ElementsAre(1)) << "nor does a last solution make a start known";
}

TEST_F(UnknownStartsTest, PlacesARoverNearTheTruth) {
  Use({.seed = 2, .is_around_base = true});
  for (GraphNode& node : scenario_.graph.nodes) {
    if (node.key.agent == 2) node.map_from_node = Pose::FromPlanar(60, 5, 2) * node.map_from_node;
  }
  ForgetStarts({2});
  const std::vector<InitialValues> found = Arrange();
  ASSERT_FALSE(found.empty());
  EXPECT_LT(ErrorM(found[0], {2, 50}), 3);
  EXPECT_EQ(found[0].poses[0].position_m, initial_.poses[0].position_m) << "who knows its start stands";
}

TEST_F(UnknownStartsTest, OffersNoPlacementWhileTheLastSolutionIsTheBest) {
  Use({.seed = 3, .is_around_base = true});
  ForgetStarts({2});
  Prepare(scenario_.truth);
  EXPECT_TRUE(Arrange().empty());
}

TEST_F(UnknownStartsTest, OffersAnotherPlacementIfTheLastSolutionIsWrong) {
  Use({.seed = 3, .is_around_base = true});
  ForgetStarts({2});
  std::map<NodeKey, Pose> last = scenario_.truth;
  MoveRover(2, Pose::FromPlanar(40, 0, 1), last);
  Prepare(last);
  const std::vector<InitialValues> found = Arrange();
  ASSERT_FALSE(found.empty());
  EXPECT_LT(ErrorM(found[0], {2, 50}), 3);
}

TEST_F(UnknownStartsTest, KeepsTheRoverWithTheMostRangesIfNoStartIsKnown) {
  Use({.seed = 4, .has_base_station = false, .is_around_base = true});
  std::size_t left = 5;
  std::erase_if(scenario_.graph.ranges, [&left](const RangeEdge& edge) {
    return edge.from.agent == 1 && edge.to.agent == 3 && left > 0 && left-- > 0;
  });
  ForgetStarts({1, 2, 3});
  const std::vector<InitialValues> found = Arrange();
  ASSERT_FALSE(found.empty());
  const std::size_t second = *checked_.Find({2, 0});
  EXPECT_EQ(found[0].poses[second].position_m, initial_.poses[second].position_m);
}

}  // namespace
}  // namespace moondb
