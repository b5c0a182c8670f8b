#include "actors/merge/map_collection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>

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
  // Returns the x coordinate, in metres, of the first selected map.
  double PlacedX(bool use_raw_poses = false) {
    return collection_.Select({use_raw_poses, {}}).maps.at(0).map_from_node.position_m.x();
  }

  void AddMapOf(AgentId agent, std::uint64_t node_index = 1) {
    TraversabilityMap map = DrawMap({"."}, 50'000, agent);
    map.node.index = node_index;
    ASSERT_TRUE(collection_.AddMap(MapKey(agent, node_index), {5, false}, map));
  }

  static std::vector<RecordKey> KeysIn(const MapCollection& collection) {
    std::vector<RecordKey> keys;
    for (const auto& map : collection.Select({}).waiting_maps) keys.push_back(map->key);
    return keys;
  }

  MapCollection collection_{{}};
};

// A team of rovers 1 to 3, seen by the agent `self`. Rovers 1 and 2 have a map at their node; rover 1 has a start.
class UnplacedRoversTest : public testing::Test {
 protected:
  MapCollection CollectionAt(AgentId self) {
    MapCollection::Options options;
    options.self = self;
    options.with_start = {1};
    options.without_footprint = {9};
    MapCollection collection(options);
    for (const AgentId agent : {1, 2}) {
      EXPECT_TRUE(collection.AddMap(MapKey(agent, 1), {5, false}, DrawMap({"."}, 50'000, agent)));
      collection.AddRawPose(PoseKey(agent, 1), {agent, 1}, Pose{});
    }
    return collection;
  }

  static void Solve(MapCollection& collection, std::uint64_t run, bool is_unplaced) {
    collection.AddOptimizedPose(PoseKey(7, run), {2, 1}, {Pose::FromPlanar(3, 0, 0), false, is_unplaced}, MakeTerm(1),
                                run);
  }

  static std::vector<AgentId> PlacedIn(const MapCollection::Selected& selected) {
    std::vector<AgentId> agents;
    for (const PlacedMap& map : selected.maps) agents.push_back(map.map->agent());
    return agents;
  }
};

TEST_F(UnplacedRoversTest, AreNotInTheTeamsMap) {
  const auto selected = CollectionAt(1).Select({});
  EXPECT_EQ(PlacedIn(selected), std::vector<AgentId>{1});
  EXPECT_EQ(selected.footprints.size(), 1u);
  EXPECT_EQ(selected.waiting_maps.size(), 1u);
  EXPECT_EQ(selected.unplaced, (std::map<AgentId, std::size_t>{{2, 1}}));
  EXPECT_EQ(selected.frame_of, 0u);
}

TEST_F(UnplacedRoversTest, AreInTheMapOnceASolvePlacedThem) {
  MapCollection collection = CollectionAt(1);
  Solve(collection, 1, /*is_unplaced=*/true);
  EXPECT_EQ(PlacedIn(collection.Select({})), std::vector<AgentId>{1});
  Solve(collection, 2, /*is_unplaced=*/false);
  EXPECT_EQ(PlacedIn(collection.Select({})), (std::vector<AgentId>{1, 2}));
  EXPECT_TRUE(collection.Select({}).unplaced.empty());
  Solve(collection, 3, /*is_unplaced=*/true);
  EXPECT_EQ(PlacedIn(collection.Select({})), std::vector<AgentId>{1});
}

TEST_F(UnplacedRoversTest, NewNodesFollowTheLastSolveIntoTheMapOrOutOfIt) {
  MapCollection collection = CollectionAt(1);
  collection.AddRawPose(PoseKey(2, 2), {2, 2}, Pose::FromPlanar(1, 0, 0));
  Solve(collection, 1, /*is_unplaced=*/true);
  EXPECT_EQ(collection.Select({}).footprints.size(), 1u);
  Solve(collection, 2, /*is_unplaced=*/false);
  const auto selected = collection.Select({});
  ASSERT_EQ(selected.footprints.size(), 3u);
  EXPECT_NEAR(selected.footprints[2].map_from_node.position_m.x(), 4, 1e-9) << "one metre after the solved node";
}

// The raw pose of a rover without a start lies in the rover's own frame, also after a solve.
TEST_F(UnplacedRoversTest, NodesBeforeTheFirstSolvedOneWait) {
  MapCollection collection = CollectionAt(1);
  Solve(collection, 1, /*is_unplaced=*/false);
  collection.AddRawPose(PoseKey(2, 2), {2, 0}, Pose{});
  EXPECT_EQ(collection.Select({}).footprints.size(), 2u) << "one of each rover";
}

TEST_F(UnplacedRoversTest, SeeTheirOwnMapAloneAtTheirOwnAgent) {
  MapCollection collection = CollectionAt(2);
  auto selected = collection.Select({});
  EXPECT_EQ(PlacedIn(selected), std::vector<AgentId>{2});
  EXPECT_EQ(selected.frame_of, 2u);
  EXPECT_TRUE(selected.waiting_maps.empty());
  Solve(collection, 1, /*is_unplaced=*/false);
  selected = collection.Select({});
  EXPECT_EQ(PlacedIn(selected), (std::vector<AgentId>{1, 2}));
  EXPECT_EQ(selected.frame_of, 0u);
}

TEST_F(UnplacedRoversTest, CanBeSelectedAlone) {
  const MapCollection collection = CollectionAt(1);
  EXPECT_EQ(PlacedIn(collection.Select({false, {2}})), std::vector<AgentId>{2});
  EXPECT_EQ(collection.Select({false, {2}}).frame_of, 2u);
  EXPECT_EQ(PlacedIn(collection.Select({false, {1, 2}})), std::vector<AgentId>{1});
  EXPECT_EQ(PlacedIn(collection.Select({true, {}})), std::vector<AgentId>{1}) << "raw poses need a start";
}

TEST_F(UnplacedRoversTest, DoNotHideTheTeamsMapFromAnAgentWithoutNodes) {
  EXPECT_EQ(PlacedIn(CollectionAt(3).Select({})), std::vector<AgentId>{1});
  EXPECT_EQ(PlacedIn(CollectionAt(9).Select({})), std::vector<AgentId>{1});
}

TEST_F(MapCollectionTest, AMapCountsOnce) {
  AddMapOf(1);
  AddMapOf(1);
  EXPECT_EQ(collection_.map_count(), 1u);
}

TEST_F(MapCollectionTest, AMapWaitsForItsNode) {
  AddMapOf(1);
  EXPECT_EQ(collection_.Select({}).waiting_maps.size(), 1u);
  collection_.AddRawPose(PoseKey(1, 1), {1, 1}, Pose{});
  const auto selected = collection_.Select({});
  EXPECT_EQ(selected.waiting_maps.size(), 0u);
  EXPECT_EQ(selected.maps.size(), 1u);
  EXPECT_EQ(selected.footprints.size(), 1u);
}

TEST_F(MapCollectionTest, TheNewestTermAndRunPlacesTheNodeInAnyOrder) {
  AddMapOf(1);
  collection_.AddOptimizedPose(PoseKey(1, 3), {1, 1}, {Pose::FromPlanar(3, 0, 0)}, MakeTerm(2), 1);
  collection_.AddOptimizedPose(PoseKey(1, 4), {1, 1}, {Pose::FromPlanar(2, 0, 0)}, MakeTerm(1), 9);
  EXPECT_EQ(PlacedX(), 3);
  collection_.AddRawPose(PoseKey(1, 1), {1, 1}, Pose::FromPlanar(1, 0, 0));
  EXPECT_EQ(PlacedX(), 3);
  EXPECT_EQ(PlacedX(/*use_raw_poses=*/true), 1);
  collection_.AddOptimizedPose(PoseKey(1, 5), {1, 1}, {Pose::FromPlanar(4, 0, 0)}, MakeTerm(2), 2);
  EXPECT_EQ(PlacedX(), 4);
}

TEST_F(MapCollectionTest, AMapAfterASolveIsCarriedOnByOdometry) {
  AddMapOf(1, 3);
  for (const std::uint64_t index : {1, 2, 3}) {
    collection_.AddRawPose(PoseKey(1, index), {1, index}, Pose::FromPlanar(static_cast<double>(index), 0, 0));
  }
  EXPECT_NEAR(PlacedX(), 3, 1e-9);
  collection_.AddOptimizedPose(PoseKey(7, 1), {1, 1}, {Pose::FromPlanar(11, 0, 0)}, MakeTerm(1), 1);
  EXPECT_NEAR(PlacedX(), 13, 1e-9);
  EXPECT_NEAR(PlacedX(/*use_raw_poses=*/true), 3, 1e-9);
  EXPECT_EQ(collection_.PoseOf({1, 3})->source, PoseSource::kCarried);
}

TEST_F(MapCollectionTest, AMapWaitsForTheNextSolveIfOdometryIsCut) {
  AddMapOf(1, 3);
  collection_.AddRawPose(PoseKey(1, 1), {1, 1}, Pose{});
  collection_.AddRawPose(PoseKey(1, 3), {1, 3}, Pose{});
  collection_.AddOptimizedPose(PoseKey(7, 1), {1, 1}, {Pose::FromPlanar(11, 0, 0)}, MakeTerm(1), 1);
  auto selected = collection_.Select({});
  EXPECT_TRUE(selected.maps.empty());
  EXPECT_EQ(selected.footprints.size(), 1u);
  ASSERT_EQ(selected.cut.count(1), 1u);
  EXPECT_EQ(selected.cut[1].first_index, 3u);
  EXPECT_EQ(selected.cut[1].map_count, 1u);
  EXPECT_EQ(collection_.Select({/*use_raw_poses=*/true, {}}).maps.size(), 1u);
  collection_.AddOptimizedPose(PoseKey(7, 2), {1, 3}, {Pose::FromPlanar(13, 0, 0)}, MakeTerm(1), 2);
  selected = collection_.Select({});
  EXPECT_EQ(selected.maps.size(), 1u);
  EXPECT_TRUE(selected.cut.empty());
}

TEST_F(MapCollectionTest, TheSmallerKeyOfTwoRecordsOfOneNodeWins) {
  AddMapOf(1);
  collection_.AddRawPose(PoseKey(1, 2), {1, 1}, Pose::FromPlanar(2, 0, 0));
  collection_.AddRawPose(PoseKey(1, 1), {1, 1}, Pose::FromPlanar(1, 0, 0));
  collection_.AddRawPose(PoseKey(1, 3), {1, 1}, Pose::FromPlanar(3, 0, 0));
  EXPECT_EQ(PlacedX(), 1);
}

TEST_F(MapCollectionTest, ASelectionHasTheMapsAndFootprintsOfItsAgents) {
  for (const AgentId agent : {1u, 2u}) {
    AddMapOf(agent);
    collection_.AddRawPose(PoseKey(agent, 1), {agent, 1}, Pose::FromPlanar(agent, 0, 0));
  }
  const auto selected = collection_.Select({false, {2}});
  ASSERT_EQ(selected.maps.size(), 1u);
  EXPECT_EQ(selected.maps[0].map->agent(), 2u);
  EXPECT_EQ(selected.footprints.size(), 1u);
}

TEST_F(MapCollectionTest, ABaseStationLeavesNoFootprint) {
  MapCollection collection({.grid = {}, .without_footprint = {4}});
  collection.AddRawPose(PoseKey(4, 1), {4, 0}, Pose{});
  EXPECT_EQ(collection.Select({}).footprints.size(), 0u);
}

TEST_F(MapCollectionTest, QuarantinesLeaveOutExactlyTheMapsInTheirTimeRanges) {
  const TraversabilityMap map = DrawMap({"."}, 50'000);
  for (std::int64_t timestamp = 1; timestamp <= 9; ++timestamp) {
    ASSERT_TRUE(collection_.AddMap(MapKey(1, static_cast<std::uint64_t>(timestamp)), {timestamp, false}, map));
  }
  const auto quarantine = [this](std::uint64_t seq, std::int64_t from_ns, std::int64_t to_ns, AgentId agent = 1) {
    proto::MapQuarantine said;
    said.set_agent_id(agent);
    said.set_from_ns(from_ns);
    said.set_to_ns(to_ns);
    collection_.AddQuarantine({{2, 7, proto::MAP_QUARANTINE}, seq}, said);
  };
  const auto left_out = [this] {
    std::string timestamps;
    for (const auto& quarantined : collection_.Select({}).quarantined_maps) {
      timestamps += std::to_string(collection_.TimestampOf(quarantined->key).ns);
    }
    return timestamps;
  };
  EXPECT_EQ(left_out(), "");
  quarantine(1, 2, 3);
  quarantine(2, 5, 7);
  quarantine(3, 6, 6);  // This range lies within the range of quarantine 2.
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

TEST_F(MapCollectionTest, AQuarantinedNodeLosesItsPoseAndItsMaps) {
  AddMapOf(1);
  collection_.AddRawPose(PoseKey(1, 1), {1, 1}, Pose::FromPlanar(30'000, 0, 0));
  collection_.AddOptimizedPose(PoseKey(1, 2), {1, 1}, {Pose::FromPlanar(29'000, 0, 0)}, MakeTerm(1), 1);
  proto::MapQuarantine said;
  said.set_agent_id(1);
  *said.mutable_node() = ToProto(NodeKey{1, 1});
  const RecordKey key{{2, 7, proto::MAP_QUARANTINE}, 1};
  collection_.AddQuarantine(key, said);
  const auto selected = collection_.Select({});
  EXPECT_TRUE(selected.maps.empty());
  EXPECT_TRUE(selected.footprints.empty());
  EXPECT_EQ(selected.quarantined_maps.size(), 1u);
  EXPECT_FALSE(collection_.PoseOf({1, 1}));
  ASSERT_EQ(collection_.StandingQuarantines().size(), 1u);
  EXPECT_EQ(collection_.StandingQuarantines()[0].map_count, 1u);

  // A solve without the raw pose places the node again. Its maps stay left out.
  collection_.AddOptimizedPose(PoseKey(1, 3), {1, 1}, {Pose::FromPlanar(2, 0, 0), /*ignores_raw_pose=*/true},
                               MakeTerm(1), 2);
  EXPECT_EQ(collection_.Select({}).footprints.size(), 1u);
  EXPECT_TRUE(collection_.Select({}).maps.empty());
  proto::MapQuarantine lift;
  *lift.mutable_lifts() = ToProto(key);
  collection_.AddQuarantine({{2, 7, proto::MAP_QUARANTINE}, 2}, lift);
  EXPECT_EQ(PlacedX(), 2);
}

TEST_F(MapCollectionTest, ANodeThatLiesAbsurdlyFarAwayIsLeftOutAndNamed) {
  AddMapOf(1);
  for (std::uint64_t i = 1; i < 20; ++i) {
    const double x = i == 1 ? 30'000 : static_cast<double>(i);
    collection_.AddRawPose(PoseKey(1, i), {1, i}, Pose::FromPlanar(x, 0, 0));
  }
  const auto selected = collection_.Select({});
  EXPECT_TRUE(selected.maps.empty());
  EXPECT_EQ(selected.footprints.size(), 18u);
  ASSERT_EQ(selected.far_nodes.size(), 1u);
  EXPECT_EQ(selected.far_nodes[0].node, (NodeKey{1, 1}));
}

TEST_F(MapCollectionTest, LimitsAgentsWithTheMostMapsToTheirNewestMaps) {
  const TraversabilityMap map = DrawMap({".."}, 50'000);
  MapCollection collection({.grid = {}, .without_footprint = {}, .maps_max = 5});
  ASSERT_TRUE(collection.AddMap(MapKey(1, 1), {5, false}, map));
  for (std::uint64_t seq = 1; seq <= 9; ++seq) ASSERT_TRUE(collection.AddMap(MapKey(3, seq), {5, false}, map));
  EXPECT_EQ(collection.map_count(), 5u);
  EXPECT_EQ(KeysIn(collection),
            (std::vector<RecordKey>{MapKey(1, 1), MapKey(3, 6), MapKey(3, 7), MapKey(3, 8), MapKey(3, 9)}));
  EXPECT_EQ(collection.CountLeftOut(), (std::map<AgentId, std::uint64_t>{{3, 5}}));
}

TEST_F(MapCollectionTest, LimitsTheBytesOfAllMaps) {
  const TraversabilityMap small = DrawMap({".."}, 50'000);
  const TraversabilityMap large = DrawMap(std::vector<std::string>(64, std::string(64, '.')), 50'000);
  const std::uint64_t bytes = (*MakeLocalMap(MapKey(1, 1), 5, large, {}))->bytes();
  MapCollection collection({.grid = {}, .without_footprint = {}, .bytes_max = bytes * 5 / 2});
  ASSERT_TRUE(collection.AddMap(MapKey(1, 1), {5, false}, small));
  for (std::uint64_t seq = 1; seq <= 9; ++seq) ASSERT_TRUE(collection.AddMap(MapKey(3, seq), {5, false}, large));
  EXPECT_EQ(KeysIn(collection), (std::vector<RecordKey>{MapKey(1, 1), MapKey(3, 8), MapKey(3, 9)}));
  EXPECT_LE(collection.map_bytes(), bytes * 5 / 2);
}

TEST_F(MapCollectionTest, LimitsNodesOptimizedPosesAndQuarantines) {
  MapCollection collection({.grid = {}, .without_footprint = {}, .nodes_max = 2, .quarantines_max = 2});
  for (std::uint64_t seq = 1; seq <= 3; ++seq) {
    collection.AddRawPose(PoseKey(3, seq), {3, seq}, Pose{});
    collection.AddOptimizedPose(PoseKey(2, seq), {5, seq}, {Pose{}}, MakeTerm(1), 1);
    proto::MapQuarantine said;
    said.set_agent_id(4);
    collection.AddQuarantine({{4, 7, proto::MAP_QUARANTINE}, seq}, said);
  }
  EXPECT_EQ(collection.PoseOf({3, 1}), nullptr);
  EXPECT_NE(collection.PoseOf({3, 3}), nullptr);
  EXPECT_EQ(collection.StandingQuarantines().size(), 2u);
  EXPECT_EQ(collection.CountLeftOut(), (std::map<AgentId, std::uint64_t>{{3, 1}, {4, 1}, {5, 1}}));
}

// Agent 3 has more nodes than all poses that are kept. Agent 1's nodes come last.
TEST_F(MapCollectionTest, AnAgentWithManyNodesTakesNoOptimizedPosesFromOthers) {
  const std::uint64_t seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  std::vector<NodeKey> nodes;
  for (std::uint64_t index = 0; index < 50; ++index) nodes.push_back({3, index});
  for (std::uint64_t index = 0; index < 3; ++index) nodes.push_back({1, index});
  for (int round = 0; round < 10; ++round) {
    MapCollection collection({.grid = {}, .without_footprint = {}, .nodes_max = 10});
    for (const NodeKey& node : nodes) {
      collection.AddOptimizedPose(PoseKey(2, 100 * node.agent + node.index), node, {Pose{}}, MakeTerm(1), 1);
    }
    for (const NodeKey& node : nodes) {
      EXPECT_EQ(collection.PoseOf(node) != nullptr, node.agent == 1 || node.index >= 43) << node.index;
    }
    std::shuffle(nodes.begin(), nodes.end(), rng);
  }
}

TEST_F(MapCollectionTest, AQuarantineLeavesOutTheFootprintsOfItsTimesToo) {
  for (std::uint64_t index = 1; index <= 9; ++index) {
    collection_.AddRawPose(PoseKey(1, index), {1, index}, Pose{}, static_cast<std::int64_t>(index));
  }
  collection_.AddRawPose(PoseKey(2, 1), {2, 1}, Pose{}, 3);
  collection_.AddOptimizedPose(PoseKey(2, 2), {1, 20}, {Pose{}}, MakeTerm(1), 1);  // Its timestamp is unknown.
  const auto quarantine = [this](std::uint64_t seq, std::int64_t from_ns, std::int64_t to_ns) {
    proto::MapQuarantine said;
    said.set_agent_id(1);
    said.set_from_ns(from_ns);
    said.set_to_ns(to_ns);
    collection_.AddQuarantine({{2, 7, proto::MAP_QUARANTINE}, seq}, said);
  };
  EXPECT_EQ(collection_.Select({}).footprints.size(), 11u);
  quarantine(1, 3, 5);
  EXPECT_EQ(collection_.Select({}).footprints.size(), 8u);
  quarantine(2, 0, INT64_MAX);
  EXPECT_EQ(collection_.Select({}).footprints.size(), 2u);
  quarantine(3, INT64_MIN, INT64_MAX);
  const auto footprints = collection_.Select({}).footprints;
  ASSERT_EQ(footprints.size(), 1u);
  EXPECT_EQ(footprints[0].node, (NodeKey{2, 1}));
  EXPECT_EQ(footprints[0].record, PoseKey(2, 1));
}

// The limits evict some records. If a node's record is evicted, another record of the same node gives the pose. If the
// record that lifts a quarantine is evicted, the quarantine applies again.
TEST_F(MapCollectionTest, DependsOnTheSetOfRecordsAndNotOnTheirOrder) {
  const std::uint64_t first_seed = std::random_device()();
  const TraversabilityMap map = DrawMap({"."}, 50'000);
  for (std::uint64_t seed = first_seed; seed < first_seed + 50; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    std::vector<std::function<void(MapCollection&)>> records;
    for (const AgentId agent : {1u, 2u, 3u}) {
      for (std::uint64_t seq = 1; seq <= 1 + rng() % 8; ++seq) {
        records.emplace_back([=](MapCollection& collection) {
          ASSERT_TRUE(collection.AddMap(MapKey(agent, seq), {static_cast<std::int64_t>(seq), false}, map));
        });
        const NodeKey node{agent, 1 + seq % 3};
        const Pose pose = Pose::FromPlanar(static_cast<double>(seq), 0, 0);
        records.emplace_back(
            [=](MapCollection& collection) { collection.AddRawPose(PoseKey(agent, seq), node, pose); });
        const Pose solved = Pose::FromPlanar(static_cast<double>(rng() % 100), 0, 0);
        records.emplace_back([=](MapCollection& collection) {
          collection.AddOptimizedPose(PoseKey(7, seq), {agent, 1 + seq % 2}, {solved}, MakeTerm(1), seq);
        });
        proto::MapQuarantine said;
        if (seq % 2 == 0) {
          *said.mutable_lifts() =
              ToProto(RecordKey{{static_cast<AgentId>(1 + rng() % 3), 7, proto::MAP_QUARANTINE}, 1 + 2 * (rng() % 4)});
        } else {
          said.set_agent_id(static_cast<AgentId>(1 + rng() % 3));
          said.set_from_ns(static_cast<std::int64_t>(seq));
          said.set_to_ns(static_cast<std::int64_t>(seq));
        }
        records.emplace_back([=](MapCollection& collection) {
          collection.AddQuarantine({{agent, 7, proto::MAP_QUARANTINE}, seq}, said);
        });
      }
    }
    std::string expected;
    for (int order = 0; order < 5; ++order) {
      MapCollection collection(
          {.grid = {}, .without_footprint = {}, .maps_max = 9, .nodes_max = 10, .quarantines_max = 8});
      for (const auto& add : records) {
        add(collection);
        if (rng() % 4 == 0) (void)collection.Select({});  // Poses derived here must not outlive the next record.
      }
      std::string text;
      const auto selected = collection.Select({});
      for (const auto& placed : selected.maps) {
        text += ToString(placed.map->key) + " at " + std::to_string(placed.map_from_node.position_m.x()) + ", ";
      }
      for (const auto& waiting : selected.waiting_maps) text += ToString(waiting->key) + " waits, ";
      for (const auto& left_out : selected.quarantined_maps) text += ToString(left_out->key) + " left out, ";
      if (order == 0) expected = text;
      EXPECT_EQ(text, expected);
      std::shuffle(records.begin(), records.end(), rng);
    }
  }
}

}  // namespace
}  // namespace moondb
