#include "apps/moondb_view/graph_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

class GraphBookTest : public testing::Test {
 protected:
  GraphBookTest() {
    for (std::uint32_t id = 1; id <= 2; ++id) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      if (id == 1) agent.mutable_start()->set_x(0);
    }
  }

  static void Set(std::uint32_t agent, std::uint64_t index, proto::NodeKey& node) {
    node.set_agent_id(agent);
    node.set_index(index);
  }
  static void SetX(double x_m, proto::Pose& pose) {
    pose.mutable_position_m()->set_x(x_m);
    pose.mutable_orientation()->set_w(1);
  }

  void Add(std::uint32_t origin, DataType type, const proto::Record& record) {
    book_.Add(RecordKey{{origin, 7, type}, ++seq_}, record);
  }
  void AddNode(std::uint32_t agent, std::uint64_t index, double x_m) {
    proto::Record record;
    record.set_timestamp_ns(static_cast<std::int64_t>(1'800'000'001 + index) * 1'000'000'000);
    Set(agent, index, *record.mutable_pose_graph_node()->mutable_node());
    SetX(x_m, *record.mutable_pose_graph_node()->mutable_map_from_node());
    Add(agent, proto::POSE_GRAPH_NODE, record);
  }
  void AddPose(std::uint32_t agent, std::uint64_t index, double x_m, bool is_unplaced = false) {
    proto::Record record;
    proto::OptimizedPose& pose = *record.mutable_optimized_pose();
    Set(agent, index, *pose.mutable_node());
    SetX(x_m, *pose.mutable_map_from_node());
    pose.set_run(++run_);
    pose.set_is_unplaced(is_unplaced);
    Add(1, proto::OPTIMIZED_POSE, record);
  }
  void AddRange(std::uint64_t index) {
    proto::Record record;
    Set(1, index, *record.mutable_pose_graph_edge()->mutable_from());
    Set(2, index, *record.mutable_pose_graph_edge()->mutable_to());
    record.mutable_pose_graph_edge()->mutable_range()->set_range_m(3);
    record.mutable_pose_graph_edge()->mutable_range()->set_variance_m2(0.01);
    Add(1, proto::POSE_GRAPH_EDGE, record);
  }

  proto::TeamConfig team_;
  GraphBook book_{team_};
  std::uint64_t seq_ = 0;
  std::uint64_t run_ = 0;
};

TEST_F(GraphBookTest, DrawsTheNewestPoses) {
  AddNode(1, 0, 1);
  AddNode(1, 1, 2);
  EXPECT_THAT(PosesJson(team_, book_.View()),
              HasSubstr(R"("name":"rover1","is_placed":true,"time_s":[1800000001,1800000002],)"
                        R"("x_m":[1,2],"y_m":[0,0],"yaw_rad":[0,0],"is_optimized":[0,0]})"));
  AddPose(1, 0, 11);
  // The later node is carried on from the optimized one.
  EXPECT_THAT(PosesJson(team_, book_.View()),
              HasSubstr(R"("x_m":[11,12],"y_m":[0,0],"yaw_rad":[0,0],"is_optimized":[1,0]})"));
}

TEST_F(GraphBookTest, SaysWhichRobotIsNotPlaced) {
  AddNode(1, 0, 1);
  AddNode(2, 0, 1);
  AddRange(0);
  EXPECT_THAT(PosesJson(team_, book_.View()), HasSubstr(R"("name":"rover2","is_placed":false)")) << "it has no start";
  EXPECT_EQ(LinesJson(team_, book_.View()), R"({"lines":[]})") << "a line from nowhere";
  AddPose(2, 0, 5, /*is_unplaced=*/true);
  EXPECT_FALSE(book_.View().tracks.at(1).is_placed);
  AddPose(2, 0, 5);
  EXPECT_TRUE(book_.View().tracks.at(1).is_placed);
  EXPECT_EQ(LinesJson(team_, book_.View()), R"({"lines":[["range",1,0,5,0,0,"rover1:0","rover2:0"]]})");
}

TEST_F(GraphBookTest, MarksRejectedMeasurements) {
  AddNode(1, 0, 1);
  AddNode(2, 0, 1);
  AddPose(2, 0, 5);
  AddRange(0);
  proto::Record record;
  Set(1, 0, *record.mutable_edge_verdict()->mutable_from());
  Set(2, 0, *record.mutable_edge_verdict()->mutable_to());
  record.mutable_edge_verdict()->set_is_range(true);
  record.mutable_edge_verdict()->set_is_inlier(false);
  record.mutable_edge_verdict()->set_run(9);
  Add(1, proto::EDGE_VERDICT, record);
  EXPECT_EQ(LinesJson(team_, book_.View()), R"({"lines":[["range",1,0,5,0,1,"rover1:0","rover2:0"]]})");
}

TEST_F(GraphBookTest, ThinsLongTracksAndKeepsTheNewestPose) {
  for (std::uint64_t i = 0; i <= 2 * GraphBook::kTrackPosesMax; ++i) AddNode(1, i, 1e-3 * static_cast<double>(i));
  const std::string poses = PosesJson(team_, book_.View());
  EXPECT_LT(std::count(poses.begin(), poses.end(), ','), 5 * static_cast<int>(GraphBook::kTrackPosesMax) + 10);
  EXPECT_THAT(poses, HasSubstr("1800004001],\"x_m\""));
}

TEST_F(GraphBookTest, IgnoresDamagedPoses) {
  AddNode(1, 0, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(PosesJson(team_, book_.View()), R"({"agents":[]})");
}

}  // namespace
}  // namespace moondb
