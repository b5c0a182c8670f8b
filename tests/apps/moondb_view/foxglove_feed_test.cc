#include "apps/moondb_view/foxglove_feed.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::ElementsAre;

class FoxgloveFeedTest : public testing::Test {
 protected:
  FoxgloveFeedTest() {
    for (std::uint32_t id = 1; id <= 2; ++id) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
    }
  }

  std::uint32_t IdOf(const std::string& topic) const {
    for (const Channel& channel : channels_.List()) {
      if (channel.topic == topic) return channel.id;
    }
    return 0;
  }
  template <typename Message>
  Message Newest(const std::string& topic) const {
    Message message;
    const auto next = channels_.FindNext(IdOf(topic), 0);
    EXPECT_TRUE(next) << topic;
    if (next) {
      EXPECT_TRUE(message.ParseFromString(*next->message.payload));
    }
    return message;
  }

  static MergedTile TileAt(std::int64_t x, std::int64_t y, Cell fill) {
    MergedTile tile{x, y, {}};
    tile.map.grid = Grid(64, 64, fill);
    tile.map.resolution_um = 50'000;
    return tile;
  }
  static GraphView ViewOf(AgentId agent, bool is_placed) {
    PoseView pose{{agent, 3}, 1'800'000'000'500'000'000, Pose::FromPlanar(1, 2, M_PI / 2), true};
    return {{{{agent, {pose}}, is_placed}}, {}};
  }

  proto::TeamConfig team_;
  Channels channels_;
  FoxgloveFeed feed_{channels_, team_};
};

TEST_F(FoxgloveFeedTest, JoinsTilesToBlocks) {
  feed_.BeginMap(0);
  feed_.SetTiles({TileAt(0, 0, Cell::kFree), TileAt(3, 3, Cell::kHazard), TileAt(-1, -1, Cell::kFree)});
  const auto grid = Newest<foxglove::Grid>("/map/0_0");
  EXPECT_EQ(grid.frame_id(), "map");
  EXPECT_EQ(grid.column_count(), 256u);
  EXPECT_EQ(grid.data().size(), 256u * 256);
  EXPECT_EQ(grid.data()[0], 1);
  EXPECT_EQ(grid.data()[63 * 256 + 63], 1);
  EXPECT_EQ(grid.data()[64], 0) << "unknown";
  EXPECT_EQ(grid.data().back(), 2);
  EXPECT_DOUBLE_EQ(grid.cell_size().x(), 0.05);
  const auto other = Newest<foxglove::Grid>("/map/-1_-1");
  EXPECT_DOUBLE_EQ(other.pose().position().x(), -12.8);
  EXPECT_EQ(other.data().back(), 1) << "the tile at the upper right corner of its block";
  EXPECT_EQ(other.data()[0], 0);
  feed_.BeginMap(2);
  EXPECT_EQ(IdOf("/map/0_0"), 0u);
  feed_.SetTiles({TileAt(0, 0, Cell::kFree)});
  EXPECT_EQ(Newest<foxglove::Grid>("/map/0_0").frame_id(), "rover2/map") << "a map in a frame of its own";
}

TEST_F(FoxgloveFeedTest, ShowsPlacedRobotsAlone) {
  feed_.SetGraph(ViewOf(2, true));
  const auto transforms = Newest<foxglove::FrameTransforms>("/tf");
  ASSERT_EQ(transforms.transforms_size(), 1);
  EXPECT_EQ(transforms.transforms(0).parent_frame_id(), "map");
  EXPECT_EQ(transforms.transforms(0).child_frame_id(), "rover2");
  EXPECT_EQ(transforms.transforms(0).timestamp().seconds(), 1'800'000'000);
  EXPECT_EQ(transforms.transforms(0).timestamp().nanos(), 500'000'000);
  EXPECT_DOUBLE_EQ(transforms.transforms(0).translation().y(), 2);
  EXPECT_NEAR(transforms.transforms(0).rotation().z(), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(Newest<foxglove::PosesInFrame>("/poses").poses_size(), 1);
  EXPECT_EQ(Newest<foxglove::SceneUpdate>("/graph").entities(0).id(), "track rover2");
  feed_.SetGraph(ViewOf(2, false));
  EXPECT_EQ(Newest<foxglove::FrameTransforms>("/tf").transforms_size(), 0);
}

TEST_F(FoxgloveFeedTest, DrawsRejectedMeasurementsApart) {
  GraphView view = ViewOf(1, true);
  DrawnLine line;
  line.map_from_to = Pose::FromPlanar(3, 0, 0);
  line.is_rejected = true;
  view.lines = {line};
  feed_.SetGraph(view);
  int points = 0;
  const auto scene = Newest<foxglove::SceneUpdate>("/graph");
  for (const auto& entity : scene.entities()) {
    if (entity.id() == "rejected ranges") points = entity.lines(0).points_size();
    if (entity.id() == "ranges") {
      EXPECT_EQ(entity.lines(0).points_size(), 0);
    }
  }
  EXPECT_EQ(points, 2);
}

TEST_F(FoxgloveFeedTest, AddsEachEventOnceInTheOrderOfTime) {
  const EventView first{1'000, 1, Severity::kInfo, "started", "one", ""};
  const EventView second{2'000, 2, Severity::kError, "damage", "two", "anna"};
  const EventView late{500, 2, Severity::kInfo, "started", "came late", ""};
  feed_.AddEvents({first});
  feed_.AddEvents({second, first});
  feed_.AddEvents({second, first, late});
  std::vector<std::string> messages;
  for (std::uint64_t after = 0; const auto next = channels_.FindNext(IdOf("/events"), after);) {
    foxglove::Log log;
    ASSERT_TRUE(log.ParseFromString(*next->message.payload));
    messages.push_back(log.name() + " " + log.message() + " " + std::to_string(log.level()));
    after = next->message.version;
  }
  EXPECT_THAT(messages,
              ElementsAre("rover1 started: one 2", "rover2 damage: two (anna) 4", "rover2 started: came late 2"));
}

TEST_F(FoxgloveFeedTest, SchemasHoldAllThatTheyImport) {
  google::protobuf::FileDescriptorSet files;
  ASSERT_TRUE(files.ParseFromString(SchemaOf(*foxglove::SceneUpdate::descriptor())));
  std::vector<std::string> names;
  for (const auto& file : files.file()) names.push_back(file.name());
  EXPECT_THAT(names,
              ElementsAre("google/protobuf/duration.proto", "google/protobuf/timestamp.proto", "foxglove.proto"));
}

}  // namespace
}  // namespace moondb
