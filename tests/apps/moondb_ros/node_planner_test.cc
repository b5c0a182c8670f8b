#include "apps/moondb_ros/node_planner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

class NodePlannerTest : public testing::Test {
 protected:
  // Feeds 20 messages a second; `pose_at` gives the pose at a time.
  template <typename PoseAt>
  void Feed(double from_s, double to_s, const PoseAt& pose_at) {
    for (int i = 0; from_s + i / 20.0 <= to_s + 1e-9; ++i) {
      const double seconds = from_s + i / 20.0;
      (void)track_.Add(OdometryAt(seconds, pose_at(seconds)));
      if (const auto node = planner_.Next(track_, has_room_)) nodes_.push_back(*node);
    }
  }

  bool has_room_ = true;
  OdometryTrack track_;
  NodePlanner planner_{NodeRule{}};
  std::vector<PlannedNode> nodes_;
};

TEST_F(NodePlannerTest, MakesNodesAtWholeSecondsOncePerMetre) {
  Feed(0.4, 6, [](double seconds) { return Pose::FromPlanar(seconds, 0, 0); });
  ASSERT_GE(nodes_.size(), 3u);
  EXPECT_EQ(nodes_[0].timestamp_ns, At(1));
  for (const PlannedNode& node : nodes_) {
    EXPECT_EQ(node.timestamp_ns % 1'000'000'000, 0);
    EXPECT_NEAR(node.track_from_node.position_m.x(), static_cast<double>(node.timestamp_ns - At(0)) * 1e-9, 1e-6);
    EXPECT_FALSE(node.is_after_jump);
  }
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    EXPECT_GE(nodes_[i].track_from_node.position_m.x() - nodes_[i - 1].track_from_node.position_m.x(), 1);
  }
}

TEST_F(NodePlannerTest, MakesANodeAfterATurn) {
  Feed(0, 10, [](double seconds) { return Pose::FromPlanar(0, 0, 0.2 * seconds); });
  // The first at 0 s; 30 degrees are turned after 2.6 s each.
  ASSERT_EQ(nodes_.size(), 4u);
  EXPECT_EQ(nodes_[1].timestamp_ns, At(3));
  EXPECT_EQ(nodes_[2].timestamp_ns, At(6));
}

TEST_F(NodePlannerTest, MakesANodeEachMinuteWhereTheRobotStands) {
  Feed(0, 130, [](double) { return Pose::FromPlanar(1, 2, 0); });
  ASSERT_EQ(nodes_.size(), 3u);
  EXPECT_EQ(nodes_[1].timestamp_ns, At(60));
  EXPECT_EQ(nodes_[2].timestamp_ns, At(120));
}

TEST_F(NodePlannerTest, MarksTheFirstNodeAfterAJump) {
  Feed(0, 3, [](double seconds) { return Pose::FromPlanar(seconds, 0, 0); });
  Feed(3.05, 6, [](double seconds) { return Pose::FromPlanar(seconds + 50, 0, 0); });
  std::vector<bool> marks;
  for (const PlannedNode& node : nodes_) marks.push_back(node.is_after_jump);
  EXPECT_EQ(std::count(marks.begin(), marks.end(), true), 1);
  EXPECT_FALSE(marks.front());
}

TEST_F(NodePlannerTest, GoesOnAfterOdometryPaused) {
  Feed(0, 1.1, [](double seconds) { return Pose::FromPlanar(seconds, 0, 0); });
  Feed(300, 303, [](double seconds) { return Pose::FromPlanar(seconds - 298, 0, 0); });
  ASSERT_GE(nodes_.size(), 2u);
  EXPECT_GE(nodes_.back().timestamp_ns, At(300));
}

TEST_F(NodePlannerTest, MeasuresTheWholeWayWhileThereIsNoRoom) {
  Feed(0, 0.4, [](double) { return Pose(); });
  ASSERT_EQ(nodes_.size(), 1u);
  has_room_ = false;
  // 10 m there and back, so that the step to the next node is short.
  Feed(1, 21, [](double seconds) { return Pose::FromPlanar(10 - std::abs(seconds - 11), 0, 0); });
  has_room_ = true;
  Feed(21.05, 24, [](double seconds) { return Pose::FromPlanar(seconds - 21, 0, 0); });
  ASSERT_GE(nodes_.size(), 2u);
  EXPECT_LT(nodes_[1].track_from_node.position_m.norm(), 3);
  EXPECT_NEAR(nodes_[1].way.length_m, 20 + nodes_[1].track_from_node.position_m.x(), 0.5);
}

TEST_F(NodePlannerTest, TheNoiseOfARobotThatStandsIsNoWay) {
  Feed(0, 62, [](double seconds) {
    return Pose::FromPlanar(0.02 * std::sin(40 * seconds), 0, 0.01 * std::cos(30 * seconds));
  });
  ASSERT_EQ(nodes_.size(), 2u);
  EXPECT_EQ(nodes_[1].way.length_m, 0);
  EXPECT_EQ(nodes_[1].way.turn_rad, 0);
}

TEST(OdometryStepTest, GrowsWithTheWay) {
  const proto::RelativePose step = OdometryStep(Pose(), {20, 6}, proto::ODOMETRY_KIND_WHEEL);
  EXPECT_NEAR(std::sqrt(step.covariance(0)), 1.01, 1e-9);
  EXPECT_NEAR(std::sqrt(step.covariance(20)), 0.005 + 0.2 + 0.3, 1e-9);
}

TEST(OdometryStepTest, GrowsWithTheStep) {
  const proto::RelativePose standing = OdometryStep(Pose(), {}, proto::ODOMETRY_KIND_WHEEL);
  ASSERT_EQ(standing.covariance_size(), 21);
  EXPECT_NEAR(standing.covariance(0), 0.01 * 0.01, 1e-12);
  EXPECT_NEAR(standing.covariance(20), 0.005 * 0.005, 1e-12);
  const proto::RelativePose step = OdometryStep(Pose::FromPlanar(2, 0, 0.5), {}, proto::ODOMETRY_KIND_WHEEL);
  EXPECT_NEAR(std::sqrt(step.covariance(0)), 0.11, 1e-9);
  EXPECT_NEAR(std::sqrt(step.covariance(6)), 0.11, 1e-9);
  EXPECT_NEAR(std::sqrt(step.covariance(11)), 0.033, 1e-9);
  EXPECT_NEAR(std::sqrt(step.covariance(20)), 0.005 + 0.02 + 0.025, 1e-9);
  const proto::RelativePose by_lidar = OdometryStep(Pose::FromPlanar(2, 0, 0.5), {}, proto::ODOMETRY_KIND_LIDAR);
  EXPECT_NEAR(std::sqrt(by_lidar.covariance(0)), 0.03, 1e-9);
  EXPECT_NEAR(std::sqrt(UnsureStep(Pose()).covariance(0)), 5, 1e-9);
  EXPECT_NEAR(std::sqrt(UnsureStep(Pose()).covariance(20)), 1.0472, 1e-4);
}

}  // namespace
}  // namespace moondb
