#include "apps/moondb_replay/feed_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;

// A mission with a base station and one rover. The rover has three nodes 10 s apart, each with a map. There are two
// ranges: from the rover's second node to the base station, and from the base station to the rover's third node.
class FeedPlanTest : public testing::Test {
 protected:
  FeedPlanTest() {
    mission_.folder = temporary_.path();
    std::filesystem::create_directories(mission_.folder / "maps");
    MissionAgent rover{1, "rover1", false, 'A', {}, 0, 0, Eigen::Vector3d::Zero()};
    MissionAgent base{2, "base", true, 'L', {}, 0, 0, Eigen::Vector3d::Zero()};
    mission_.agents = {rover, base};
    for (std::uint64_t i = 0; i < 3; ++i) AddNode(i);
    mission_.graph.ranges.push_back({{1, 1}, {2, 0}, Timestamp(1), 4, 0.01});
    mission_.graph.ranges.push_back({{2, 0}, {1, 2}, Timestamp(2), 4, 0.01});
    mission_.graph.nodes.push_back({{2, 0}, 0, Pose()});
  }
  static std::int64_t Timestamp(std::uint64_t index) { return static_cast<std::int64_t>(index) * 10'000'000'000; }

  void AddNode(std::uint64_t index) {
    mission_.graph.nodes.push_back({{1, index}, Timestamp(index), Pose::FromPlanar(static_cast<double>(index), 0, 0)});
    if (index > 0) {
      OdometryEdge edge;
      edge.from = {1, index - 1};
      edge.to = {1, index};
      edge.timestamp_ns = Timestamp(index);
      mission_.graph.odometry.push_back(edge);
    }
    mission_.truth[{1, index}] = Pose::FromPlanar(777, 777, 0);
    MissionMap map;
    map.agent = 1;
    map.timestamp_ns = Timestamp(index);
    map.node = {1, index};
    map.layers = 1;
    map.cells_per_side = 4;
    map.finest_resolution_m = 0.05;
    map.file = "maps/" + std::to_string(index) + ".png";
    TraversabilityMap grid;
    grid.layers.push_back({Grid(4, 4, Cell::kFree), 50000, 0, 0});
    ASSERT_TRUE(WriteMissionMap(mission_.folder / map.file, grid).has_value());
    mission_.maps.push_back(map);
  }

  std::vector<proto::Record> Plan(AgentId agent, TimeSpan span) {
    auto records = PlanFeed(mission_, agent, span);
    EXPECT_TRUE(records.has_value()) << ToString(records.error());
    return *records;
  }

  static std::vector<proto::Record::BodyCase> Bodies(const std::vector<proto::Record>& records) {
    std::vector<proto::Record::BodyCase> bodies;
    for (const proto::Record& record : records) bodies.push_back(record.body_case());
    return bodies;
  }

  const TemporaryFolder temporary_;
  Mission mission_;
  const TimeSpan all_{INT64_MIN, INT64_MAX};
};

TEST_F(FeedPlanTest, OrdersByTimestampWithStatesAndNodesFirstAndMapsLast) {
  using R = proto::Record;
  EXPECT_THAT(Bodies(Plan(1, all_)),
              ElementsAre(R::kAwakeStatus, R::kMode, R::kPoseGraphNode, R::kLocalTraversabilityMap,  // Records at 0 s.
                          R::kPoseGraphNode, R::kPoseGraphEdge, R::kPoseGraphEdge, R::kLocalTraversabilityMap,
                          R::kPoseGraphNode, R::kPoseGraphEdge, R::kLocalTraversabilityMap));
}

TEST_F(FeedPlanTest, GivesARangeToTheAgentOfItsFirstEnd) {
  const auto base = Plan(2, all_);
  ASSERT_EQ(base.size(), 4u);  // Two states, one node and one range of the base station.
  EXPECT_EQ(base[3].pose_graph_edge().from().agent_id(), 2u);
  EXPECT_EQ(base[1].mode().activity(), proto::ACTIVITY_IDLE);
}

TEST_F(FeedPlanTest, SplitsAMissionIntoHalvesThatMeet) {
  const std::size_t first = Plan(1, {INT64_MIN, Timestamp(1)}).size();
  const std::size_t second = Plan(1, {Timestamp(1), INT64_MAX}).size();
  EXPECT_EQ(first, 4u);
  EXPECT_EQ(second, Plan(1, all_).size() - first + 2);  // Each half begins with two states.
}

TEST_F(FeedPlanTest, NeverFeedsGroundTruth) {
  for (const AgentId agent : {1u, 2u}) {
    for (const proto::Record& record : Plan(agent, all_)) {
      EXPECT_NE(record.pose_graph_node().map_from_node().position_m().x(), 777);
    }
  }
}

TEST_F(FeedPlanTest, RecordsHaveDistinctIdentities) {
  std::set<std::string> keys;
  const auto records = Plan(1, all_);
  for (const proto::Record& record : records) keys.insert(FeedKey(record));
  EXPECT_EQ(keys.size(), records.size());
}

TEST_F(FeedPlanTest, MovesAMissionWithoutDatesTo2026) {
  const std::vector<proto::Record> records = Plan(1, {0, INT64_MAX});
  EXPECT_EQ(records.front().timestamp_ns(), kFeedStart_ns);
  EXPECT_EQ(records.back().timestamp_ns(), kFeedStart_ns + Timestamp(2));
  const std::int64_t dated_ns = 1'700'000'000'000'000'000;
  for (GraphNode& node : mission_.graph.nodes) node.timestamp_ns += dated_ns;
  for (RangeEdge& range : mission_.graph.ranges) range.timestamp_ns += dated_ns;
  for (MissionMap& map : mission_.maps) map.timestamp_ns += dated_ns;
  EXPECT_EQ(Plan(2, {0, INT64_MAX}).front().timestamp_ns(), dated_ns);
}

}  // namespace
}  // namespace moondb
