#include "actors/merge/map_collection.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

RecordKey PoseKey(AgentId agent, std::uint64_t seq) { return {{agent, 7, proto::POSE_GRAPH_NODE}, seq}; }

proto::Term MakeTerm(std::uint64_t number) {
  proto::Term term;
  term.set_number(number);
  term.set_issuer(1);
  return term;
}

class MapCollectionTest : public testing::Test {
 protected:
  // Where the only map lies.
  double PlacedX(bool use_raw_poses = false) {
    return collection_.Select({use_raw_poses, {}}).maps.at(0).map_from_node.position_m.x();
  }

  void PutMapOf(AgentId agent) {
    ASSERT_TRUE(collection_.PutMap(MapKey(agent, 1), {5, false}, DrawMap({"."}, 50'000, agent)).value());
  }

  MapCollection collection_{{}};
};

TEST_F(MapCollectionTest, AMapCountsOnce) {
  PutMapOf(1);
  EXPECT_FALSE(collection_.PutMap(MapKey(1, 1), {5, false}, DrawMap({"."}, 50'000)).value());
  EXPECT_EQ(collection_.map_count(), 1u);
}

TEST_F(MapCollectionTest, AMapWaitsForItsNode) {
  PutMapOf(1);
  EXPECT_EQ(collection_.Select({}).waiting_maps.size(), 1u);
  ASSERT_TRUE(collection_.SetRawPose(PoseKey(1, 1), {1, 1}, Pose{}));
  const auto selected = collection_.Select({});
  EXPECT_EQ(selected.waiting_maps.size(), 0u);
  EXPECT_EQ(selected.maps.size(), 1u);
  EXPECT_EQ(selected.footprints.size(), 1u);
}

TEST_F(MapCollectionTest, TheNewestTermAndRunPlacesTheNodeInAnyOrder) {
  PutMapOf(1);
  ASSERT_TRUE(collection_.SetOptimizedPose(PoseKey(1, 3), {1, 1}, Pose::FromPlanar(3, 0, 0), MakeTerm(2), 1));
  ASSERT_TRUE(collection_.SetOptimizedPose(PoseKey(1, 4), {1, 1}, Pose::FromPlanar(2, 0, 0), MakeTerm(1), 9));
  EXPECT_EQ(PlacedX(), 3);
  ASSERT_TRUE(collection_.SetRawPose(PoseKey(1, 1), {1, 1}, Pose::FromPlanar(1, 0, 0)));
  EXPECT_EQ(PlacedX(), 3);
  EXPECT_EQ(PlacedX(/*use_raw_poses=*/true), 1);
  ASSERT_TRUE(collection_.SetOptimizedPose(PoseKey(1, 5), {1, 1}, Pose::FromPlanar(4, 0, 0), MakeTerm(2), 2));
  EXPECT_EQ(PlacedX(), 4);
}

TEST_F(MapCollectionTest, OfTwoRecordsOfOneNodeTheSmallerKeyStands) {
  PutMapOf(1);
  ASSERT_TRUE(collection_.SetRawPose(PoseKey(1, 2), {1, 1}, Pose::FromPlanar(2, 0, 0)));
  ASSERT_TRUE(collection_.SetRawPose(PoseKey(1, 1), {1, 1}, Pose::FromPlanar(1, 0, 0)));
  ASSERT_TRUE(collection_.SetRawPose(PoseKey(1, 3), {1, 1}, Pose::FromPlanar(3, 0, 0)));
  EXPECT_EQ(PlacedX(), 1);
}

TEST_F(MapCollectionTest, ASelectionTakesMapsAndFootprintsOfItsAgents) {
  for (const AgentId agent : {1u, 2u}) {
    PutMapOf(agent);
    ASSERT_TRUE(collection_.SetRawPose(PoseKey(agent, 1), {agent, 1}, Pose::FromPlanar(agent, 0, 0)));
  }
  const auto selected = collection_.Select({false, {2}});
  ASSERT_EQ(selected.maps.size(), 1u);
  EXPECT_EQ(selected.maps[0].map->agent(), 2u);
  EXPECT_EQ(selected.footprints.size(), 1u);
}

TEST_F(MapCollectionTest, ABaseStationLeavesNoFootprint) {
  MapCollection collection({.grid = {}, .without_footprint = {4}});
  ASSERT_TRUE(collection.SetRawPose(PoseKey(4, 1), {4, 0}, Pose{}));
  EXPECT_EQ(collection.Select({}).footprints.size(), 0u);
}

TEST_F(MapCollectionTest, QuarantinesLeaveOutExactlyTheStampsTheyName) {
  const TraversabilityMap map = DrawMap({"."}, 50'000);
  for (std::int64_t stamp = 1; stamp <= 9; ++stamp) {
    ASSERT_TRUE(collection_.PutMap(MapKey(1, static_cast<std::uint64_t>(stamp)), {stamp, false}, map));
  }
  const auto quarantine = [this](std::uint64_t seq, std::int64_t from_ns, std::int64_t to_ns, AgentId agent = 1) {
    proto::MapQuarantine said;
    said.set_agent_id(agent);
    said.set_from_ns(from_ns);
    said.set_to_ns(to_ns);
    ASSERT_TRUE(collection_.AddQuarantine({{2, 7, proto::MAP_QUARANTINE}, seq}, said));
  };
  const auto left_out = [this] {
    std::string stamps;
    for (const auto& quarantined : collection_.Select({}).quarantined_maps) {
      stamps += std::to_string(collection_.StampOf(quarantined->key).ns);
    }
    return stamps;
  };
  EXPECT_EQ(left_out(), "");
  quarantine(1, 2, 3);
  quarantine(2, 5, 7);
  quarantine(3, 6, 6);  // Within another one.
  quarantine(4, 1, 9, /*agent=*/2);
  EXPECT_EQ(left_out(), "23567");
  quarantine(5, 7, 8);
  quarantine(6, INT64_MIN, -1);
  EXPECT_EQ(left_out(), "235678");
  quarantine(7, 9, INT64_MAX);
  EXPECT_EQ(left_out(), "2356789");
  const auto standing = collection_.StandingQuarantines();
  ASSERT_EQ(standing.size(), 7u);
  EXPECT_EQ(standing[1].map_count, 3u);
  EXPECT_EQ(standing[3].map_count, 0u);
}

TEST_F(MapCollectionTest, HoldsNoMoreThanItsBounds) {
  const TraversabilityMap map = DrawMap({".."}, 50'000);
  const std::size_t map_bytes = (*MakeLocalMap(MapKey(1, 1), 5, map, {}))->bytes();
  MapCollection collection(
      {.grid = {}, .without_footprint = {}, .maps_max = 2, .bytes_max = map_bytes * 3 / 2, .nodes_max = 1});
  ASSERT_TRUE(collection.PutMap(MapKey(1, 1), {5, false}, map));
  EXPECT_EQ(collection.PutMap(MapKey(1, 2), {5, false}, map).error().code, ErrorCode::kFull);
  MapCollection of_two({.grid = {}, .without_footprint = {}, .maps_max = 2});
  for (const std::uint64_t seq : {1u, 2u}) ASSERT_TRUE(of_two.PutMap(MapKey(1, seq), {5, false}, map));
  EXPECT_EQ(of_two.PutMap(MapKey(1, 4), {5, false}, map).error().code, ErrorCode::kFull);
  ASSERT_TRUE(collection.SetRawPose(PoseKey(1, 1), {1, 1}, Pose{}));
  EXPECT_EQ(collection.SetRawPose(PoseKey(1, 2), {1, 2}, Pose{}).error().code, ErrorCode::kFull);
}

}  // namespace
}  // namespace moondb
