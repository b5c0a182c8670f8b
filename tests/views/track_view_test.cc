#include "views/track_view.h"

#include <gtest/gtest.h>

#include "views/event_view.h"
#include "views/map_view.h"

namespace moondb {
namespace {

PoseView PoseAt(AgentId agent, std::uint64_t index, std::int64_t timestamp_ns, bool is_optimized = false) {
  return {{agent, index}, timestamp_ns, Pose{}, is_optimized};
}

TEST(TrackViewTest, MakesOneTrackPerAgentInTheOrderOfTime) {
  const std::vector<TrackView> tracks =
      TracksOf({PoseAt(2, 1, 30), PoseAt(1, 0, 40), PoseAt(2, 0, 20, true), PoseAt(2, 3, 10), PoseAt(2, 2, 10)});
  ASSERT_EQ(tracks.size(), 2u);
  EXPECT_EQ(tracks[0].agent, 1u);
  EXPECT_EQ(tracks[0].CountOptimized(), 0u);
  EXPECT_EQ(tracks[1].agent, 2u);
  EXPECT_EQ(tracks[1].CountOptimized(), 1u);
  std::vector<std::uint64_t> indices;
  for (const PoseView& pose : tracks[1].poses) indices.push_back(pose.node.index);
  EXPECT_EQ(indices, (std::vector<std::uint64_t>{2, 3, 0, 1}));
  EXPECT_TRUE(TracksOf({}).empty());
}

TEST(MapViewTest, GivesTheValuesOfAnOccupancyGrid) {
  MapView view;
  view.map.grid = Grid(3, 1);
  view.map.grid.At(1, 0) = Cell::kFree;
  view.map.grid.At(2, 0) = Cell::kHazard;
  view.map.resolution_um = 50'000;
  view.map.origin_cell_x = -20;
  view.map.origin_cell_y = 4;
  EXPECT_EQ(view.Occupancy(), (std::vector<std::int8_t>{-1, 0, 100}));
  EXPECT_DOUBLE_EQ(view.origin_x_m(), -1.0);
  EXPECT_DOUBLE_EQ(view.origin_y_m(), 0.2);
}

TEST(EventViewTest, DamageIsAnErrorAndAStartIsNot) {
  proto::Record record;
  record.mutable_agent_event()->set_kind(proto::EVENT_KIND_DAMAGE);
  record.mutable_agent_event()->set_text("set aside");
  record.set_timestamp_ns(5);
  const RecordKey key{{3, 1, 40}, 1};
  const EventView damage = EventViewOf(key, record);
  EXPECT_EQ(damage.severity, Severity::kError);
  EXPECT_EQ(damage.agent, 3u);
  EXPECT_EQ(damage.timestamp_ns, 5);
  EXPECT_EQ(damage.TextBy(), "set aside");
  record.mutable_agent_event()->set_kind(proto::EVENT_KIND_COMMAND);
  record.mutable_agent_event()->set_by("anna@hill");
  EXPECT_EQ(EventViewOf(key, record).severity, Severity::kInfo);
  EXPECT_EQ(EventViewOf(key, record).TextBy(), "set aside (anna@hill)");
}

}  // namespace
}  // namespace moondb
