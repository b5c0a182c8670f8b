#include "apps/moondb_ros/robot_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class RobotMapperTest : public testing::Test {
 protected:
  RobotMapperTest() {
    options_.agent = 2;
    options_.boot_id = "boot";
  }

  // Drives along x at 1 m/s and sees a wall at 2.02 m all around, 10 times a second.
  void Drive(RobotMapper& mapper, double from_s, double to_s, bool has_room = true) {
    for (int i = 0; from_s + i / 10.0 <= to_s + 1e-9; ++i) {
      const double seconds = from_s + i / 10.0;
      if (has_scans_) mapper.OnScan(ScanAt(seconds, 2.02F));
      auto made = mapper.OnOdometry(OdometryAt(seconds, Pose::FromPlanar(seconds, 0, 0)), has_room);
      if (made) made_.push_back(*std::move(made));
    }
  }

  std::vector<std::string> printed_;
  TopicLog log_{[this](const std::string& line) { printed_.push_back(line); }, std::chrono::seconds(5)};
  RobotMapper::Options options_;
  bool has_scans_ = true;
  std::vector<RobotMapper::Made> made_;
};

TEST_F(RobotMapperTest, MakesNodesOdometryAndMaps) {
  RobotMapper mapper(options_, std::nullopt, log_);
  mapper.OnTransform(TransformAt(0, "base_link", "laser", Pose()), true);
  Drive(mapper, 0, 5);
  ASSERT_GE(made_.size(), 2u);
  EXPECT_EQ(made_[1].records.size(), 3u);
  EXPECT_TRUE(made_[1].records[2].has_local_traversability_map());
  EXPECT_EQ(made_[1].state.node_index(), 1u);
  EXPECT_THAT(printed_, ElementsAre());
}

TEST_F(RobotMapperTest, ANodeWithoutATransformHasNoMap) {
  RobotMapper mapper(options_, std::nullopt, log_);
  Drive(mapper, 0, 5);
  ASSERT_GE(made_.size(), 2u);
  EXPECT_EQ(made_[1].records.size(), 2u);
  EXPECT_THAT(printed_, ElementsAre("/scan: no transform places its scans at the robot: the node has no map"));
  EXPECT_EQ(log_.topics().at("/scan").reasons.begin()->second, made_.size());
}

TEST_F(RobotMapperTest, ContinuesTheOdometryOfTheLastProcess) {
  std::optional<RobotMapper::Stored> stored;
  {
    RobotMapper mapper(options_, std::nullopt, log_);
    Drive(mapper, 0, 5);
    const auto& last = *mapper.last_node();
    stored = {last.index, last.timestamp_ns, last.map_from_node, made_.back().state};
  }
  const auto sigma_of_first = [this](const RobotMapper::Stored& from) {
    RobotMapper mapper(options_, from, log_);
    made_.clear();
    Drive(mapper, 6, 9);
    EXPECT_EQ(made_.front().records[0].pose_graph_node().node().index(), from.index + 1);
    return std::sqrt(made_.front().records[1].pose_graph_edge().relative_pose().covariance(0));
  };
  EXPECT_LT(sigma_of_first(*stored), 0.5);
  stored->state.set_boot_id("another");
  EXPECT_NEAR(sigma_of_first(*stored), 5, 1e-9);
  stored->state.Clear();
  EXPECT_NEAR(sigma_of_first(*stored), 5, 1e-9);
  EXPECT_THAT(printed_.back(), HasSubstr("does not continue from node"));
}

TEST_F(RobotMapperTest, DropsOdometryThatIsNone) {
  RobotMapper mapper(options_, std::nullopt, log_);
  Drive(mapper, 0, 1);
  EXPECT_FALSE(mapper.OnOdometry(OdometryAt(0.5, Pose()), true));
  EXPECT_EQ(log_.topics().at("/odom").dropped_count, 1u);
  EXPECT_THAT(printed_.back(), HasSubstr("/odom: its timestamp is not after the one before"));
}

TEST_F(RobotMapperTest, WithoutRoomTheNextStepIsLonger) {
  RobotMapper mapper(options_, std::nullopt, log_);
  Drive(mapper, 0, 2);
  Drive(mapper, 2.1, 12, /*has_room=*/false);
  const std::size_t before = made_.size();
  Drive(mapper, 12.1, 15);
  double longest_m = 0;
  for (std::size_t i = 1; i < made_.size(); ++i) {
    EXPECT_EQ(made_[i].records[0].pose_graph_node().node().index(), i);
    const auto& step = made_[i].records[1].pose_graph_edge().relative_pose().from_from_to();
    longest_m = std::max(longest_m, step.position_m().x());
  }
  EXPECT_GT(made_.size(), before);
  EXPECT_GT(longest_m, 8);
}

TEST_F(RobotMapperTest, AScanFromTheFutureDoesNotEndMaps) {
  RobotMapper mapper(options_, std::nullopt, log_);
  mapper.OnTransform(TransformAt(0, "base_link", "laser", Pose()), true);
  Drive(mapper, 0, 1);
  mapper.OnScan(ScanAt(100, 2.02F));
  EXPECT_THAT(printed_, ElementsAre("/scan: its timestamp lies more than 3 s after odometry"));
  Drive(mapper, 1.1, 6);
  ASSERT_GE(made_.size(), 2u);
  EXPECT_EQ(made_.back().records.size(), 3u);
}

TEST_F(RobotMapperTest, TakesMapsFromGrids) {
  options_.grid_topics = {"/map"};
  RobotMapper mapper(options_, std::nullopt, log_);
  mapper.OnGrid(0, GridAt(1, "odom"));
  Drive(mapper, 0, 5);
  ASSERT_GE(made_.size(), 2u);
  EXPECT_TRUE(made_[1].records[2].has_local_traversability_map());
  RosGrid rotated = GridAt(2, "odom");
  rotated.frame_from_origin = Pose::FromPlanar(0, 0, 1);
  mapper.OnGrid(0, rotated);
  EXPECT_THAT(printed_, ElementsAre("/map: its origin is rotated"));
}

TEST(TopicLogTest, PrintsEachReasonOnceAndCountsIt) {
  std::vector<std::string> printed;
  TopicLog log([&printed](const std::string& line) { printed.push_back(line); }, std::chrono::seconds(5));
  const TopicLog::Time start{};
  log.Hear("/scan", start);
  log.Drop("/scan", "is bad");
  log.Drop("/scan", "is bad");
  EXPECT_THAT(printed, ElementsAre("/scan: is bad"));
  EXPECT_EQ(log.topics().at("/scan").dropped_count, 2u);
  for (int i = 0; i < 1000; ++i) log.Drop("/scan", "reason " + std::to_string(i));
  EXPECT_LE(log.topics().at("/scan").reasons.size(), TopicLog::kReasonsMax + 1);
  EXPECT_LE(printed.size(), TopicLog::kReasonsMax);
}

TEST(TopicLogTest, SaysOnceThatATopicFellSilent) {
  std::vector<std::string> printed;
  TopicLog log([&printed](const std::string& line) { printed.push_back(line); }, std::chrono::seconds(5));
  const TopicLog::Time start{};
  log.Hear("/odom", start);
  log.CheckSilence(start + std::chrono::seconds(4));
  EXPECT_THAT(printed, ElementsAre());
  log.CheckSilence(start + std::chrono::seconds(6));
  log.CheckSilence(start + std::chrono::seconds(60));
  EXPECT_THAT(printed, ElementsAre("/odom: last heard 6 s ago"));
  log.Hear("/odom", start + std::chrono::seconds(61));
  EXPECT_THAT(printed, ElementsAre("/odom: last heard 6 s ago", "/odom: is heard again"));
}

}  // namespace
}  // namespace moondb
