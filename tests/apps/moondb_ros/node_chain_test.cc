#include "apps/moondb_ros/node_chain.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

double SigmaX(const proto::Record& edge) { return std::sqrt(edge.pose_graph_edge().relative_pose().covariance(0)); }

TEST(NodeChainTest, BeginsAtTheStartAndComposesSteps) {
  NodeChain chain(7, proto::ODOMETRY_KIND_WHEEL, Pose::FromPlanar(5, 5, M_PI / 2), std::nullopt);
  const auto first = chain.Next({At(1), Pose::FromPlanar(3, 0, 0), false}, nullptr);
  ASSERT_TRUE(first);
  ASSERT_EQ(first->size(), 1u);
  EXPECT_EQ((*first)[0].pose_graph_node().node().agent_id(), 7u);
  EXPECT_EQ((*first)[0].pose_graph_node().node().index(), 0u);
  EXPECT_NEAR((*first)[0].pose_graph_node().map_from_node().position_m().x(), 5, 1e-9);

  TraversabilityMap map;
  map.layers.push_back({Grid(4, 4, Cell::kFree), 50'000, 0, 0});
  const auto second = chain.Next({At(2), Pose::FromPlanar(4, 0, 0), false}, &map);
  ASSERT_TRUE(second);
  ASSERT_EQ(second->size(), 3u);
  EXPECT_NEAR((*second)[0].pose_graph_node().map_from_node().position_m().y(), 6, 1e-9);
  EXPECT_EQ((*second)[1].pose_graph_edge().from().index(), 0u);
  EXPECT_EQ((*second)[1].pose_graph_edge().to().index(), 1u);
  EXPECT_NEAR((*second)[1].pose_graph_edge().relative_pose().from_from_to().position_m().x(), 1, 1e-9);
  EXPECT_NEAR(SigmaX((*second)[1]), 0.06, 1e-9);
  EXPECT_EQ((*second)[2].local_traversability_map().node().index(), 1u);
  for (const proto::Record& record : *second) EXPECT_EQ(record.timestamp_ns(), At(2));
}

TEST(NodeChainTest, AJumpMakesTheStepUnsure) {
  NodeChain chain(7, proto::ODOMETRY_KIND_WHEEL, Pose(), std::nullopt);
  ASSERT_TRUE(chain.Next({At(1), Pose(), false}, nullptr));
  const auto next = chain.Next({At(2), Pose::FromPlanar(1, 0, 0), true}, nullptr);
  ASSERT_TRUE(next);
  EXPECT_NEAR(SigmaX((*next)[1]), 5, 1e-9);
}

TEST(NodeChainTest, ContinuesAfterTheNodesInTheStore) {
  const NodeChain::Last last{41, At(0), Pose::FromPlanar(2, 0, 0), std::nullopt};
  NodeChain unsure(7, proto::ODOMETRY_KIND_WHEEL, Pose(), last);
  const auto node = unsure.Next({At(1), Pose::FromPlanar(9, 9, 0), false}, nullptr);
  ASSERT_TRUE(node);
  EXPECT_EQ((*node)[0].pose_graph_node().node().index(), 42u);
  EXPECT_NEAR((*node)[0].pose_graph_node().map_from_node().position_m().x(), 2, 1e-9);
  EXPECT_NEAR(SigmaX((*node)[1]), 5, 1e-9);

  NodeChain measured(7, proto::ODOMETRY_KIND_WHEEL, Pose(), last);
  measured.Continue(Pose::FromPlanar(8, 9, 0));
  const auto goes_on = measured.Next({At(1), Pose::FromPlanar(9, 9, 0), false}, nullptr);
  ASSERT_TRUE(goes_on);
  EXPECT_NEAR((*goes_on)[0].pose_graph_node().map_from_node().position_m().x(), 3, 1e-9);
  EXPECT_NEAR(SigmaX((*goes_on)[1]), 0.06, 1e-9);
}

TEST(NodeChainTest, MakesNoNodeBeforeTheNewestOwnOne) {
  NodeChain chain(7, proto::ODOMETRY_KIND_WHEEL, Pose(), NodeChain::Last{3, At(100), Pose(), std::nullopt});
  const auto older = chain.Next({At(5), Pose(), false}, nullptr);
  ASSERT_FALSE(older);
  EXPECT_NE(older.error().text.find("new team folder"), std::string::npos);
  EXPECT_EQ(chain.last()->index, 3u);
  EXPECT_TRUE(chain.Next({At(101), Pose(), false}, nullptr));
}

proto::RosState StateAt(double seconds, const Pose& pose) {
  proto::RosState state;
  state.set_timestamp_ns(At(seconds));
  state.set_boot_id("boot");
  state.set_odometry_frame("odom");
  *state.mutable_odom_from_node() = ToProto(pose);
  return state;
}

TEST(IsContinuedTest, OdometryThatIsNearGoesOn) {
  EXPECT_TRUE(IsContinued(StateAt(0, Pose::FromPlanar(3, 0, 0)), StateAt(30, Pose::FromPlanar(5, 1, 0))));
}

TEST(IsContinuedTest, OdometryThatJumpedOrBeganAgainDoesNot) {
  const proto::RosState saved = StateAt(0, Pose::FromPlanar(3, 0, 0));
  EXPECT_FALSE(IsContinued(saved, StateAt(30, Pose::FromPlanar(12, 0, 0))));
  EXPECT_FALSE(IsContinued(saved, StateAt(30, Pose::FromPlanar(0.1, 0, 0)))) << "3 m are no jump, but it is the origin";
  EXPECT_FALSE(IsContinued(saved, StateAt(-1, Pose::FromPlanar(3, 0, 0)))) << "time began again";
  EXPECT_TRUE(IsContinued(StateAt(0, Pose()), StateAt(30, Pose::FromPlanar(0.1, 0, 0)))) << "the robot stood there";
}

TEST(IsContinuedTest, AfterAMinuteTheWayIsUnknown) {
  const proto::RosState saved = StateAt(0, Pose::FromPlanar(3, 0, 0));
  EXPECT_TRUE(IsContinued(saved, StateAt(59, Pose::FromPlanar(3.5, 0, 0))));
  EXPECT_FALSE(IsContinued(saved, StateAt(61, Pose::FromPlanar(3.5, 0, 0))));
}

TEST(IsContinuedTest, ARestartedComputerOrAnotherFrameDoesNot) {
  proto::RosState now = StateAt(30, Pose::FromPlanar(3, 0, 0));
  now.set_boot_id("another");
  EXPECT_FALSE(IsContinued(StateAt(0, Pose::FromPlanar(3, 0, 0)), now));
  now = StateAt(30, Pose::FromPlanar(3, 0, 0));
  now.set_odometry_frame("other");
  EXPECT_FALSE(IsContinued(StateAt(0, Pose::FromPlanar(3, 0, 0)), now));
  EXPECT_FALSE(IsContinued(proto::RosState(), now));
}

}  // namespace
}  // namespace moondb
