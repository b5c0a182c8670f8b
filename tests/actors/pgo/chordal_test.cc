#include "actors/pgo/chordal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

// One robot drives a square with sides of 1 m in the plane.
class ChordalTest : public testing::Test {
 protected:
  ChordalTest() {
    graph_.is_planar = true;
    for (std::uint64_t i = 0; i < 4; ++i) AddPose({1, i});
    for (std::size_t i = 0; i < 3; ++i) graph_.steps.push_back({i, i + 1, turn_, 50, 100});
    active_.assign(4, true);
  }

  void AddPose(const NodeKey& key) { graph_.nodes.push_back({key, Pose{}, 0, false, false}); }

  PlainState Chordal() { return ChordalParts(graph_, active_, FindHeads(graph_, active_)); }

  static Eigen::Vector3d PlaceOf(const PlainState& state, std::size_t node) {
    return FromBlock(state[node]).position_m;
  }

  const Pose turn_ = Pose::FromPlanar(1, 0, M_PI / 2);
  StandaloneGraph graph_;
  ActiveNodes active_;
};

TEST_F(ChordalTest, JoinsNodesThatActiveEdgesConnect) {
  AddPose({2, 0});
  active_ = {true, true, true, true, true};
  EXPECT_THAT(FindHeads(graph_, active_), testing::ElementsAre(0, 0, 0, 0, 4));
  active_[1] = false;
  EXPECT_THAT(FindHeads(graph_, active_), testing::ElementsAre(0, 1, 2, 2, 4));
}

TEST_F(ChordalTest, FindsALoopOnlyIfItsEdgesAreActive) {
  EXPECT_FALSE(HasLoops(graph_, active_, FindHeads(graph_, active_)));
  graph_.steps.push_back({3, 0, turn_, 50, 100});
  EXPECT_TRUE(HasLoops(graph_, active_, FindHeads(graph_, active_)));
  active_[2] = false;
  EXPECT_FALSE(HasLoops(graph_, active_, FindHeads(graph_, active_)));
}

TEST_F(ChordalTest, ComposesStepsIfThereIsNoLoop) {
  const PlainState state = Chordal();
  EXPECT_LT((PlaceOf(state, 2) - Eigen::Vector3d(1, 1, 0)).norm(), 1e-12);
  EXPECT_LT((PlaceOf(state, 3) - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
}

TEST_F(ChordalTest, DistributesAnErrorOverTheStepsOfALoop) {
  graph_.steps.push_back({3, 0, Pose::FromPlanar(1.2, 0, M_PI / 2), 50, 100});  // This step is 0.2 m too long.
  const PlainState state = Chordal();
  const double last_m = PlaceOf(state, 3).norm();
  EXPECT_GT(last_m, 1.02);
  EXPECT_LT(last_m, 1.18);
}

TEST_F(ChordalTest, PlacesASightedPoint) {
  graph_.nodes.push_back({{50, 0}, Pose{}, 0, true, false});
  graph_.sightings.push_back({1, 4, {2, 0, 0}, 10});
  active_.push_back(true);
  EXPECT_LT((PlaceOf(Chordal(), 4) - Eigen::Vector3d(1, 2, 0)).norm(), 1e-12);
}

TEST_F(ChordalTest, ComposesFromPlacedNodesAndLeavesUnconnectedOnes) {
  AddPose({2, 0});
  graph_.steps.push_back({0, 2, Pose::FromPlanar(9, 9, 0), 50, 100});  // A step between nodes that are not consecutive.
  active_.assign(5, true);
  PlainState state(5, ToBlock(Pose{}));
  std::vector<bool> placed = {true, false, false, false, false};
  ComposeFromPlaced(graph_, active_, ComposeAlong::kWay, placed, state);
  EXPECT_THAT(placed, testing::ElementsAre(true, true, true, true, false));
  EXPECT_LT((PlaceOf(state, 2) - Eigen::Vector3d(1, 1, 0)).norm(), 1e-12);

  placed = {true, false, false, false, false};
  ComposeFromPlaced(graph_, active_, ComposeAlong::kAll, placed, state);
  EXPECT_LT((PlaceOf(state, 2) - Eigen::Vector3d(9, 9, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace moondb
