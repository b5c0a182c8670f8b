#include "apps/moondb_ros/team_frame.h"

#include <gtest/gtest.h>

#include "apps/moondb_ros/record_outbox.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr AgentId kSelf = 2;

class TeamFrameTest : public testing::Test {
 protected:
  void AddNode(std::uint64_t index, const Pose& raw) {
    proto::Record record;
    *record.mutable_pose_graph_node()->mutable_node() = ToProto(NodeKey{kSelf, index});
    *record.mutable_pose_graph_node()->mutable_map_from_node() = ToProto(raw);
    Add(proto::POSE_GRAPH_NODE, record);
  }
  void AddSolved(AgentId agent, std::uint64_t index, const Pose& optimized, std::uint64_t run = 1) {
    proto::Record record;
    *record.mutable_optimized_pose()->mutable_node() = ToProto(NodeKey{agent, index});
    *record.mutable_optimized_pose()->mutable_map_from_node() = ToProto(optimized);
    record.mutable_optimized_pose()->set_run(run);
    Add(proto::OPTIMIZED_POSE, record);
  }
  void Add(DataType type, const proto::Record& record) {
    proto::StoredRecord stored;
    *stored.mutable_key() = ToProto(RecordKey{{1, 1, type}, ++seq_});
    frame_.Add(stored, record);
  }

  TeamFrame frame_{kSelf, /*is_start_known=*/true};
  std::uint64_t seq_ = 0;
};

TEST_F(TeamFrameTest, HasNoValueWithoutANodeOfThisProcess) {
  EXPECT_FALSE(frame_.TeamFromTrack());
  AddNode(0, Pose());
  EXPECT_FALSE(frame_.TeamFromTrack());
}

TEST_F(TeamFrameTest, IsTheRawPoseBeforeASolveAndTheOptimizedOneAfter) {
  AddNode(5, Pose::FromPlanar(10, 0, 0));
  frame_.AddTrack(5, Pose::FromPlanar(1, 0, 0));
  EXPECT_NEAR(frame_.TeamFromTrack()->position_m.x(), 9, 1e-9);
  AddSolved(kSelf, 5, Pose::FromPlanar(10.5, 0.2, 0));
  EXPECT_NEAR(frame_.TeamFromTrack()->position_m.x(), 9.5, 1e-9);
  AddSolved(kSelf, 5, Pose::FromPlanar(11, 0.2, 0), 2);
  EXPECT_NEAR(frame_.TeamFromTrack()->position_m.x(), 10, 1e-9);
  AddSolved(3, 5, Pose::FromPlanar(99, 0, 0), 3);
  EXPECT_NEAR(frame_.TeamFromTrack()->position_m.x(), 10, 1e-9) << "another robot's node";
}

TEST_F(TeamFrameTest, CarriesTheCorrectionOnToNewerNodes) {
  AddNode(5, Pose::FromPlanar(10, 0, 0));
  AddSolved(kSelf, 5, Pose::FromPlanar(10, 1, 0));
  AddNode(6, Pose::FromPlanar(11, 0, 0));
  frame_.AddTrack(6, Pose::FromPlanar(2, 0, 0));
  const std::optional<Pose> value = frame_.TeamFromTrack();
  ASSERT_TRUE(value);
  EXPECT_NEAR(value->position_m.x(), 9, 1e-9);
  EXPECT_NEAR(value->position_m.y(), 1, 1e-9);
}

TEST_F(TeamFrameTest, HasNoValueWhileTheRobotIsNotPlaced) {
  frame_ = TeamFrame(kSelf, /*is_start_known=*/false);
  AddNode(5, Pose::FromPlanar(10, 0, 0));
  frame_.AddTrack(5, Pose::FromPlanar(1, 0, 0));
  EXPECT_FALSE(frame_.TeamFromTrack()) << "a raw pose lies in the robot's own frame";
  proto::Record unplaced;
  *unplaced.mutable_optimized_pose()->mutable_node() = ToProto(NodeKey{kSelf, 5});
  *unplaced.mutable_optimized_pose()->mutable_map_from_node() = ToProto(Pose::FromPlanar(3, 0, 0));
  unplaced.mutable_optimized_pose()->set_run(1);
  unplaced.mutable_optimized_pose()->set_is_unplaced(true);
  Add(proto::OPTIMIZED_POSE, unplaced);
  EXPECT_FALSE(frame_.TeamFromTrack());
  AddSolved(kSelf, 5, Pose::FromPlanar(4, 0, 0), 2);
  EXPECT_NEAR(frame_.TeamFromTrack()->position_m.x(), 3, 1e-9);
}

RobotMapper::Made NodeWithMap(std::uint64_t index) {
  RobotMapper::Made made;
  made.records.resize(3);
  made.records[0].mutable_pose_graph_node()->mutable_node()->set_index(index);
  made.records[1].mutable_pose_graph_edge();
  made.records[2].mutable_local_traversability_map();
  return made;
}

TEST(RecordOutboxTest, DropsTheOldestMapsAndNeverNodes) {
  RecordOutbox outbox;
  std::size_t dropped = 0;
  std::size_t added = 0;
  while (outbox.HasRoom()) dropped += outbox.Add(NodeWithMap(added++));
  EXPECT_GT(added, RecordOutbox::kRecordsMax / 3);
  EXPECT_GT(dropped, 0u);
  std::size_t records = 0;
  std::size_t maps = 0;
  for (std::size_t i = 0; i < added; ++i) {
    const auto made = outbox.Next();
    ASSERT_TRUE(made);
    EXPECT_EQ(made->records[0].pose_graph_node().node().index(), i);
    EXPECT_TRUE(made->records[1].has_pose_graph_edge());
    records += made->records.size();
    maps += made->records.size() - 2;
    outbox.Remove();
  }
  EXPECT_LE(records, RecordOutbox::kRecordsMax);
  EXPECT_EQ(maps + dropped, added);
}

TEST(RecordOutboxTest, EndsAWaitWhenClosed) {
  RecordOutbox outbox;
  outbox.Close();
  EXPECT_FALSE(outbox.Next());
}

}  // namespace
}  // namespace moondb
