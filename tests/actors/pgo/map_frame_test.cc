#include "actors/pgo/map_frame.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

class MapFrameTest : public testing::Test {
 protected:
  MapFrameTest() {
    for (const AgentId agent : {1, 2, 9}) agents_[agent].agent = agent;
    agents_[9].is_base_station = true;
    for (const AgentId agent : {1, 2}) {
      for (const std::uint64_t index : {4, 3}) {
        graph_.nodes.push_back({{agent, index}, 0, Pose::FromPlanar(agent * 10, static_cast<double>(index), 0)});
      }
    }
  }

  void Publish(NodeKey node, double x, bool is_unplaced) {
    proto::Record record;
    proto::OptimizedPose& pose = *record.mutable_optimized_pose();
    *pose.mutable_node() = ToProto(node);
    *pose.mutable_map_from_node() = ToProto(Pose::FromPlanar(x, 0, 0));
    pose.mutable_term()->set_number(1);
    pose.set_run(1);
    pose.set_is_unplaced(is_unplaced);
    ASSERT_TRUE(known_.Add({{1, 1, proto::OPTIMIZED_POSE}, ++seq_}, record));
  }

  PoseGraph graph_;
  KnownGraph known_{KnownGraph::Limits{}};
  AgentFactsMap agents_;
  std::uint64_t seq_ = 0;
};

TEST_F(MapFrameTest, IsThatOfTheLowestIdWithoutAnyStart) {
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), 1);
  ASSERT_TRUE(agents_[1].start);
  EXPECT_EQ(agents_[1].start->position_m.x(), 10);
  EXPECT_EQ(agents_[1].start->position_m.y(), 3) << "its first node";
  EXPECT_EQ(agents_[1].start_index, 3u);
  EXPECT_FALSE(agents_[2].start);
}

TEST_F(MapFrameTest, StaysThatOfThePlacedRover) {
  Publish({1, 3}, 5, /*is_unplaced=*/true);
  Publish({2, 3}, 7, /*is_unplaced=*/false);
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), 2);
  EXPECT_EQ(agents_[2].start->position_m.x(), 7);
}

TEST_F(MapFrameTest, IsKnownByAStart) {
  agents_[2].start = Pose();
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), std::nullopt);
}

TEST_F(MapFrameTest, IsKnownByAPrior) {
  graph_.priors.emplace_back().node = {2, 3};
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), std::nullopt);
}

TEST_F(MapFrameTest, IsAboutTheBaseStationWithRanges) {
  agents_[9].start = Pose();
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), 1) << "a base station without ranges says nothing";
  agents_[1].start.reset();
  graph_.ranges.push_back({{1, 3}, {9, 0}, 0, 4, 0.01});
  EXPECT_EQ(ChooseMapFrame(graph_, known_, agents_), std::nullopt);
}

}  // namespace
}  // namespace moondb
