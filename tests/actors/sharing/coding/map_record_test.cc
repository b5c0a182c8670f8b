#include "actors/sharing/coding/map_record.h"

#include <gtest/gtest.h>

#include "drawn_maps.h"
#include "records.h"

namespace moondb {
namespace {

proto::Record MapRecord(const Layers& layers) {
  proto::Record record;
  record.set_timestamp_ns(kFirstTimestamp_ns);
  TraversabilityMap map{{2, 7}, Pose::FromPlanar(0.2, 0, 0), layers};
  *record.mutable_local_traversability_map() = ToProto(map);
  return record;
}

TEST(MapRecordTest, SplitsAMapAndJoinsItAgain) {
  for (const Layers& layers : AdversarialMaps()) {
    const std::string content = MapRecord(layers).SerializeAsString();
    const std::optional<SplitMap> split = SplitMapRecord(content);
    ASSERT_TRUE(split);
    const Result<std::vector<MapLayer>> shape = LayersOfFrame(split->frame);
    ASSERT_TRUE(shape);
    for (std::size_t i = 0; i < layers.size(); ++i) {
      EXPECT_TRUE(split->layers[i].grid == layers[i].grid);
      EXPECT_EQ((*shape)[i].grid.width, layers[i].grid.width);
      EXPECT_EQ((*shape)[i].grid.height, layers[i].grid.height);
      EXPECT_EQ((*shape)[i].resolution_um, layers[i].resolution_um);
    }
    const Result<std::string> joined = JoinMap(split->frame, split->layers);
    ASSERT_TRUE(joined);
    EXPECT_EQ(*joined, content);
  }
}

TEST(MapRecordTest, DoesNotSplitOtherOrInvalidRecords) {
  const proto::Record good = MapRecord(RoomMap(1, 0, 0, 0));
  ASSERT_TRUE(SplitMapRecord(good.SerializeAsString()));
  EXPECT_FALSE(SplitMapRecord(TemperatureRecord(1).SerializeAsString()));
  EXPECT_FALSE(SplitMapRecord("no record")) << "not even a message";

  proto::Record bad_cell = good;
  bad_cell.mutable_local_traversability_map()->mutable_layers(0)->mutable_cells()->front() = '\3';
  EXPECT_FALSE(SplitMapRecord(bad_cell.SerializeAsString()));

  proto::Record no_cells = good;
  no_cells.mutable_local_traversability_map()->mutable_layers(1)->clear_cells();
  EXPECT_FALSE(SplitMapRecord(no_cells.SerializeAsString()));

  proto::Record huge = good;
  huge.mutable_local_traversability_map()->mutable_layers(0)->set_width_cells(0xFFFFFFFF);
  EXPECT_FALSE(SplitMapRecord(huge.SerializeAsString()));
  EXPECT_FALSE(LayersOfFrame(huge.SerializeAsString()));
}

TEST(MapRecordTest, DoesNotSplitRecordsWithUnknownFields) {
  const std::string good = MapRecord(RoomMap(1, 0, 0, 0)).SerializeAsString();
  const std::string unknown("\xF8\x07\x2A", 3);
  EXPECT_FALSE(SplitMapRecord(good + unknown));
  proto::Record nested = MapRecord(RoomMap(1, 0, 0, 0));
  proto::MapLayer& layer = *nested.mutable_local_traversability_map()->mutable_layers(0);
  layer.GetReflection()->MutableUnknownFields(&layer)->AddVarint(99, 1);
  EXPECT_FALSE(SplitMapRecord(nested.SerializeAsString()));
}

TEST(MapRecordTest, DoesNotSplitRecordsOutOfCanonicalOrder) {
  const proto::Record record = MapRecord(RoomMap(1, 0, 0, 0));
  proto::Record timestamp, rest = record;
  timestamp.set_timestamp_ns(record.timestamp_ns());
  rest.clear_timestamp_ns();
  EXPECT_FALSE(SplitMapRecord(rest.SerializeAsString() + timestamp.SerializeAsString()));
}

}  // namespace
}  // namespace moondb
