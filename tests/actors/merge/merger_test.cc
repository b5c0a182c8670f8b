#include "actors/merge/merger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "actors/merge/cpu_gather.h"
#include "proto/types.pb.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

std::shared_ptr<GatherBackend> MakeCpu() { return std::make_shared<CpuGather>(CpuGather::Options{}); }

PlacedMap PlaceDrawing(const std::vector<std::string>& rows, const RecordKey& key, const Pose& pose = {},
                       std::int64_t timestamp_ns = 1) {
  return {*MakeLocalMap(key, timestamp_ns, DrawMap(rows, 50'000, key.stream.origin), {}), pose};
}

// Adds, moves or withdraws a random map or footprint of `world`, in the merger and in `now`.
void ChangeSomething(std::mt19937_64& rng, const World& world, World& now, Merger& merger) {
  const auto roll = rng() % 10;
  if (roll < 7) {
    PlacedMap map = world.maps[rng() % world.maps.size()];
    const auto is_it = [&map](const PlacedMap& other) { return other.map->key == map.map->key; };
    const auto held = std::find_if(now.maps.begin(), now.maps.end(), is_it);
    if (held != now.maps.end() && roll < 2) {
      EXPECT_TRUE(merger.Withdraw(map.map->key));
      now.maps.erase(held);
      return;
    }
    if (held != now.maps.end()) {
      map.map_from_node = world.maps[rng() % world.maps.size()].map_from_node;
      now.maps.erase(held);
    }
    EXPECT_TRUE(merger.Put(map).has_value());
    now.maps.push_back(map);
    return;
  }
  const Footprint footprint{{1, rng() % 4}, world.maps[rng() % world.maps.size()].map_from_node};
  const auto is_it = [&footprint](const Footprint& other) { return other.node == footprint.node; };
  std::erase_if(now.footprints, is_it);
  if (roll == 7) {
    merger.WithdrawFootprint(footprint.node);
    return;
  }
  EXPECT_TRUE(merger.PutFootprint(footprint).has_value());
  now.footprints.push_back(footprint);
}

TEST(MergerTest, AnEmptyWorldMergesToAnEmptyMap) {
  Merger merger({}, MakeCpu());
  const Result<MergeSummary> merged = merger.Merge({});
  ASSERT_TRUE(merged.has_value());
  EXPECT_EQ(merged->version, 0u);
  EXPECT_TRUE(merger.extent().is_empty());
  EXPECT_EQ(merger.ReadCells(merger.extent())->grid, Grid());
}

TEST(MergerTest, ProvenanceNamesMapLayerAndPose) {
  TraversabilityMap map = DrawMap({"# "}, 50'000);
  map.layers.push_back(DrawMap({".."}, 50'000).layers[0]);
  Merger merger({}, MakeCpu());
  const Pose pose = Pose::FromPlanar(5, 0, 0);
  ASSERT_TRUE(merger.Put({*MakeLocalMap(MapKey(3, 9), 1, map, {}), pose}));
  ASSERT_TRUE(merger.Merge({}));
  const MergeResult merged = ReadAll(merger);
  EXPECT_EQ(merged.slots, (std::vector<std::uint32_t>{0, 0}));
  EXPECT_EQ(merged.levels, (std::vector<std::uint8_t>{0, 1}));
  ASSERT_EQ(merged.maps.size(), 1u);
  EXPECT_EQ(merged.maps[0].map->key, MapKey(3, 9));
  EXPECT_TRUE(AreSamePose(merged.maps[0].map_from_node, pose));
}

TEST(MergerTest, AnyHistoryLeadsToTheSameBytesAsAMergeFromScratch) {
  std::mt19937_64 seeds(20);
  std::size_t partial = 0;
  for (int round = 0; round < 60; ++round) {
    const std::uint64_t seed = seeds();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    World now{world.grid, {}, {}};
    Merger merger(world.grid, MakeCpu());
    for (int step = 0; step < 12; ++step) {
      for (int change = static_cast<int>(rng() % 3); change >= 0; --change) ChangeSomething(rng, world, now, merger);
      const Result<MergeSummary> merged = merger.Merge({});
      ASSERT_TRUE(merged.has_value());
      partial += merged->is_full ? 0 : 1;
      ASSERT_EQ(CountDifferences(ReadAll(merger), MergeBy(MakeCpu(), now)), 0u) << "step " << step;
    }
  }
  EXPECT_GT(partial, 300u);
}

TEST(MergerTest, AssignKeepsExactlyTheGivenMapsAndFootprints) {
  std::mt19937_64 rng(21);
  const World first = MakeRandomWorld(rng);
  World second = MakeRandomWorld(rng);
  Merger merger(first.grid, MakeCpu());
  EXPECT_TRUE(merger.Assign(first.maps, first.footprints).empty());
  ASSERT_TRUE(merger.Merge({}));
  second.grid = first.grid;
  second.maps.push_back(first.maps[0]);
  EXPECT_TRUE(merger.Assign(second.maps, second.footprints).empty());
  ASSERT_TRUE(merger.Merge({}));
  EXPECT_EQ(CountDifferences(ReadAll(merger), MergeBy(MakeCpu(), second)), 0u);
  EXPECT_TRUE(merger.Assign({}, {}).empty());
  ASSERT_TRUE(merger.Merge({}));
  EXPECT_TRUE(merger.extent().is_empty());
  EXPECT_TRUE(merger.CountWins().empty());
}

TEST(MergerTest, AssignReportsTheMapsThatItLeavesOut) {
  Merger merger({}, MakeCpu());
  const PlacedMap good = PlaceDrawing({"#"}, MapKey(1, 1));
  PlacedMap bad = PlaceDrawing({"#"}, MapKey(1, 2));
  bad.map_from_node.position_m.x() = NAN;
  const std::vector<Error> refused = merger.Assign(std::vector<PlacedMap>{good, bad}, {});
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_EQ(refused[0].field, "map_from_node");
  EXPECT_NE(refused[0].text.find(ToString(MapKey(1, 2))), std::string::npos);
  EXPECT_EQ(merger.map_count(), 1u);
}

TEST(MergerTest, OneMoreMapGathersOnlyTilesInWhichItWins) {
  Merger merger({}, MakeCpu());
  const std::vector<std::string> rows(640, std::string(640, '#'));
  ASSERT_TRUE(merger.Put(PlaceDrawing(rows, MapKey(1, 1), {}, /*timestamp_ns=*/5)));
  EXPECT_EQ(merger.Merge({})->gathered_tiles, 100u);
  ASSERT_TRUE(merger.Put(PlaceDrawing({"."}, MapKey(1, 2), Pose::FromPlanar(1, 1, 0), /*timestamp_ns=*/6)));
  const Result<MergeSummary> newer = merger.Merge({});
  EXPECT_EQ(newer->gathered_tiles, 1u);
  EXPECT_EQ(newer->changed_tiles, 1u);
  ASSERT_TRUE(merger.Put(PlaceDrawing(rows, MapKey(1, 3), {}, /*timestamp_ns=*/4)));
  EXPECT_EQ(merger.Merge({})->gathered_tiles, 0u) << "older than all that is there";
  ASSERT_TRUE(merger.Withdraw(MapKey(1, 2)));
  EXPECT_EQ(merger.Merge({})->gathered_tiles, 1u);
}

TEST(MergerTest, ListsTheTilesThatChangedSinceAVersion) {
  Merger merger({}, MakeCpu());
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#"}, MapKey(1, 1), Pose::FromPlanar(-0.05, 0, 0))));
  const std::uint64_t first = merger.Merge({})->version;
  EXPECT_EQ(merger.ChangedSince(0), (std::vector<TileKey>{{{-1, 0}, 3}}));
  EXPECT_TRUE(merger.ChangedSince(first).empty());
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#"}, MapKey(1, 2), Pose::FromPlanar(-0.05, 0, 0), 2)));
  EXPECT_EQ(merger.Merge({})->gathered_tiles, 1u);
  EXPECT_TRUE(merger.ChangedSince(first).empty()) << "another map, the same value";
  ASSERT_TRUE(merger.Put(PlaceDrawing({"."}, MapKey(1, 3), Pose::FromPlanar(3.2, 3.2, 0), 2)));
  const std::uint64_t third = merger.Merge({})->version;
  EXPECT_EQ(merger.ChangedSince(first), (std::vector<TileKey>{{{0, 0}, 5}}));
  EXPECT_TRUE(merger.Withdraw(MapKey(1, 3)));
  ASSERT_TRUE(merger.Merge({}));
  EXPECT_EQ(merger.ChangedSince(third), (std::vector<TileKey>{{{0, 0}, 5}})) << "unknown again is a change";
}

TEST(MergerTest, ObservationsOfACellBeginWithTheWinner) {
  Merger merger({}, MakeCpu());
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#"}, MapKey(1, 1), {}, 1)));
  ASSERT_TRUE(merger.Put(PlaceDrawing({"."}, MapKey(2, 1), {}, 2)));
  ASSERT_TRUE(merger.Put(PlaceDrawing({" "}, MapKey(3, 1), {}, 3)));
  ASSERT_TRUE(merger.PutFootprint({{2, 7}, Pose::FromPlanar(0, 0, 0)}));
  ASSERT_TRUE(merger.Merge({}));
  const std::vector<Observation> seen = merger.Observe(0, 0);
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[0].placed.map, nullptr);
  EXPECT_EQ(seen[0].node, (NodeKey{2, 7}));
  EXPECT_EQ(seen[0].level, kFootprintLevel);
  EXPECT_EQ(seen[1].placed.map->key, MapKey(2, 1));
  EXPECT_EQ(seen[1].cell, Cell::kFree);
  EXPECT_EQ(seen[2].placed.map->key, MapKey(1, 1));
  EXPECT_EQ(seen[2].cell, Cell::kHazard);
  EXPECT_TRUE(merger.Observe(1000, 1000).empty());
}

TEST(MergerTest, WinsAreCountedCellByCell) {
  Merger merger({}, MakeCpu());
  ASSERT_TRUE(merger.Put(PlaceDrawing({"###"}, MapKey(1, 1), {}, 1)));
  ASSERT_TRUE(merger.Put(PlaceDrawing({".. "}, MapKey(1, 2), {}, 2)));
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#  "}, MapKey(1, 3), {}, 0)));
  ASSERT_TRUE(merger.Merge({}));
  const std::vector<MapWins> wins = merger.CountWins();
  ASSERT_EQ(wins.size(), 3u);
  EXPECT_EQ(wins[0].cells, 1u);
  EXPECT_EQ(wins[1].cells, 2u);
  EXPECT_EQ(wins[2].cells, 0u);
}

// Returns a map whose cells are as large as a tile, with one known cell in each of 63 x 63 pages (4 x 4 tiles).
std::shared_ptr<const LocalMap> SparseMap(const RecordKey& key) {
  MapLayer layer{Grid(252, 252), 3'200'000, 0, 0};
  for (std::int32_t row = 0; row < 252; row += 4) {
    for (std::int32_t column = 0; column < 252; column += 4) layer.grid.At(column, row) = Cell::kHazard;
  }
  return *MakeLocalMap(key, 1, TraversabilityMap{NodeKey{1, 1}, Pose{}, {layer}}, {});
}

TEST(MergerTest, PagesWithoutKnownCellsDoNotCountTowardsTheLimit) {
  Merger merger({.pages_max = 16'384}, MakeCpu());
  const auto map = SparseMap(MapKey(1, 1));
  for (int i = 0; i < 6; ++i) {
    ASSERT_TRUE(merger.Put({map, Pose::FromPlanar(2000.0 * i, 0, 0)}));
    const auto merged = merger.Merge({});
    ASSERT_TRUE(merged.has_value()) << i << ": " << ToString(merged.error());
  }
  EXPECT_EQ(merger.forgotten(), 1u);
  EXPECT_EQ(merger.CountWins().at(0).cells, 63u * 63 * 64 * 64);
}

TEST(MergerTest, TooManyPagesAreAnErrorAndWithdrawnMapsAreFreed) {
  Merger merger({.pages_max = 16'384}, MakeCpu());
  for (std::uint64_t i = 0; i < 6; ++i) {
    ASSERT_TRUE(merger.Put({SparseMap(MapKey(1, i + 1)), Pose::FromPlanar(2000.0 * static_cast<double>(i), 0, 0)}));
  }
  EXPECT_EQ(merger.Merge({}).error().code, ErrorCode::kFull);
  std::weak_ptr<const LocalMap> moved;
  for (int i = 0; i < 3; ++i) {
    const auto map = SparseMap(MapKey(1, 6));
    EXPECT_TRUE(i == 0 || moved.expired()) << "what was withdrawn is freed";
    moved = map;
    ASSERT_TRUE(merger.Put({map, Pose::FromPlanar(-2000.0 * (i + 1), 0, 0)}));
    EXPECT_EQ(merger.Merge({}).error().code, ErrorCode::kFull);
    EXPECT_TRUE(merger.Withdraw(MapKey(1, 6)));
    EXPECT_EQ(merger.Merge({}).error().code, ErrorCode::kFull);
  }
  for (const std::uint64_t seq : {4u, 5u}) EXPECT_TRUE(merger.Withdraw(MapKey(1, seq)));
  EXPECT_TRUE(merger.Merge({}).has_value());
}

TEST(MergerTest, ReadsAnyBox) {
  std::mt19937_64 rng(23);
  const World world = MakeRandomWorld(rng);
  Merger merger(world.grid, MakeCpu());
  merger.Assign(world.maps, world.footprints);
  ASSERT_TRUE(merger.Merge({}));
  const MergeResult all = ReadAll(merger);
  const CellBox& extent = merger.extent();
  for (int round = 0; round < 50; ++round) {
    CellBox box;
    box.first_x = extent.first_x - 70 + static_cast<std::int64_t>(rng() % 200);
    box.first_y = extent.first_y - 70 + static_cast<std::int64_t>(rng() % 200);
    box.last_x = box.first_x + static_cast<std::int64_t>(rng() % 150);
    box.last_y = box.first_y + static_cast<std::int64_t>(rng() % 150);
    const Result<MergeResult> part = merger.Read(box);
    ASSERT_TRUE(part.has_value());
    EXPECT_EQ(part->merged.grid, merger.ReadCells(box)->grid);
    std::vector<bool> has_won(part->maps.size());
    for (std::int64_t y = box.first_y; y <= box.last_y; ++y) {
      for (std::int64_t x = box.first_x; x <= box.last_x; ++x) {
        const auto at = static_cast<std::size_t>((y - box.first_y) * box.width() + x - box.first_x);
        const bool is_inside = extent.Touches({x, y, x, y});
        const auto in_all =
            is_inside ? static_cast<std::size_t>((y - extent.first_y) * extent.width() + x - extent.first_x) : 0;
        ASSERT_EQ(part->merged.grid.cells[at], is_inside ? all.merged.grid.cells[in_all] : Cell::kUnknown);
        ASSERT_EQ(part->levels[at], is_inside ? all.levels[in_all] : 0);
        if (part->slots[at] == kNoSlot) continue;
        has_won[part->slots[at]] = true;
        ASSERT_EQ(part->maps[part->slots[at]].map->key, all.maps[all.slots[in_all]].map->key);
      }
    }
    EXPECT_EQ(std::count(has_won.begin(), has_won.end(), false), 0) << "the table names winners alone";
  }
  EXPECT_EQ(merger.Read({0, 0, 1'000'000, 0}).error().code, ErrorCode::kFull);
}

TEST(MergerTest, TheWidthOfAWorldIsNotLimited) {
  Merger merger({}, MakeCpu());
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#"}, MapKey(1, 1), Pose::FromPlanar(-1e6, -1e6, 0))));
  ASSERT_TRUE(merger.Put(PlaceDrawing({"."}, MapKey(1, 2), Pose::FromPlanar(1e6, 1e6, 0))));
  ASSERT_TRUE(merger.Merge({}));
  EXPECT_EQ(merger.ReadCells({-20'000'000, -20'000'000, -20'000'000, -20'000'000})->grid.At(0, 0), Cell::kHazard);
  EXPECT_EQ(merger.ReadCells({20'000'000, 20'000'000, 20'000'000, 20'000'000})->grid.At(0, 0), Cell::kFree);
  EXPECT_LT(merger.bytes(), 100'000u);
}

TEST(MergerTest, PagesAreBounded) {
  Merger merger({.pages_max = 16'384}, MakeCpu());
  TraversabilityMap map;
  map.layers.push_back({Grid(8, 8, Cell::kFree), 100'000'000, 0, 0});
  for (std::uint64_t i = 1; i <= 5; ++i) {
    ASSERT_TRUE(merger.Put({*MakeLocalMap(MapKey(1, i), 1, map, {}), Pose::FromPlanar(1e4 * double(i), 0, 0)}));
  }
  EXPECT_EQ(merger.Merge({}).error().code, ErrorCode::kFull);
  EXPECT_EQ(merger.Merge({}).error().code, ErrorCode::kFull) << "and again";
  for (std::uint64_t i = 1; i <= 5; ++i) EXPECT_TRUE(merger.Withdraw(MapKey(1, i)));
  ASSERT_TRUE(merger.Put(PlaceDrawing({"#"}, MapKey(2, 1))));
  ASSERT_TRUE(merger.Merge({}).has_value());
  EXPECT_EQ(merger.ReadCells({0, 0, 0, 0})->grid.At(0, 0), Cell::kHazard);
}

// Honest maps of rovers 1 and 2, and nodes of rover 3 that lie 13 m apart, in other pages each.
World FootprintsFarApart(std::uint64_t node_count, std::uint64_t first_node = 0) {
  World world;
  for (std::uint64_t i = 0; i < 30; ++i) {
    const auto agent = static_cast<AgentId>(1 + i % 2);
    const Pose pose = Pose::FromPlanar(static_cast<double>(i), agent, 0.1 * static_cast<double>(i));
    world.maps.push_back(
        PlaceDrawing({"#..#", ".##.", "#  #"}, MapKey(agent, i + 1), pose, static_cast<std::int64_t>(i)));
    world.footprints.push_back({{agent, i}, pose, {{agent, 1, proto::POSE_GRAPH_NODE}, i + 1}});
  }
  for (std::uint64_t i = first_node; i < node_count; ++i) {
    const Pose pose = Pose::FromPlanar(100 + 13 * static_cast<double>(i), 0, 0);
    world.footprints.push_back({{3, i}, pose, {{3, 1, proto::POSE_GRAPH_NODE}, i + 1}});
  }
  return world;
}

TEST(MergerTest, FootprintsThatLieFarApartTakeNoPagesFromOtherAgents) {
  const World world = FootprintsFarApart(17'000);
  Merger merger(world.grid, MakeCpu());
  EXPECT_TRUE(merger.Assign(world.maps, world.footprints).empty());
  ASSERT_TRUE(merger.Merge({}).has_value());
  ASSERT_EQ(merger.CountWithoutRoom().size(), 1u);
  const std::uint64_t left_out = merger.CountWithoutRoom().at(3);
  EXPECT_GT(left_out, 15'900u);
  EXPECT_LT(left_out, 16'500u) << "a footprint touches one page or two";
  EXPECT_LE(merger.page_bytes(), kPagesMax * 160'000);

  World honest = FootprintsFarApart(0);
  const MergeResult expected = MergeBy(MakeCpu(), honest);
  const CellBox box{expected.merged.origin_cell_x, expected.merged.origin_cell_y,
                    expected.merged.origin_cell_x + expected.merged.grid.width - 1,
                    expected.merged.origin_cell_y + expected.merged.grid.height - 1};
  EXPECT_EQ(CountDifferences(*merger.Read(box), expected), 0u);
}

// The kept items give the same bytes as a merge of them alone, whatever was merged before and in whatever order.
TEST(MergerTest, ItemsWithoutRoomDependOnTheSetOfItemsAlone) {
  World world = FootprintsFarApart(3'000);
  Merger merger(world.grid, MakeCpu());
  merger.Assign(world.maps, world.footprints);
  ASSERT_TRUE(merger.Merge({}).has_value());
  const std::uint64_t left_out = merger.CountWithoutRoom().at(3);
  const World kept = FootprintsFarApart(3'000, left_out);
  const Crop crop = merger.CropTo(1 << 26);
  const MergeResult merged = *merger.Read(crop.box);
  std::mt19937_64 rng(26);
  for (int round = 0; round < 4; ++round) {
    Merger other(world.grid, MakeCpu());
    const World before = FootprintsFarApart(500 + 400 * static_cast<std::uint64_t>(round), 200);
    if (round > 0) {
      other.Assign(before.maps, before.footprints);
      ASSERT_TRUE(other.Merge({}).has_value());
    }
    std::shuffle(world.footprints.begin(), world.footprints.end(), rng);
    std::shuffle(world.maps.begin(), world.maps.end(), rng);
    const World& now = round == 3 ? kept : world;
    other.Assign(now.maps, now.footprints);
    ASSERT_TRUE(other.Merge({}).has_value());
    EXPECT_EQ(other.extent(), merger.extent());
    EXPECT_EQ(other.CropTo(1 << 26).box, crop.box);
    EXPECT_EQ(CountDifferences(*other.Read(crop.box), merged), 0u) << round;
  }
}

// Old and new pages together exceed the limit.
TEST(MergerTest, AllMapsMayMoveAtOnce) {
  Merger merger({.pages_max = 40}, MakeCpu());
  for (int round = 0; round < 5; ++round) {
    std::vector<PlacedMap> maps;
    for (std::uint64_t i = 1; i <= 30; ++i) {
      const double x_m = 12.8 * (static_cast<double>(i) + 40 * (round % 2)) + 1;
      maps.push_back(PlaceDrawing({"#"}, MapKey(1, i), Pose::FromPlanar(x_m, 1, 0)));
    }
    ASSERT_TRUE(merger.Assign(maps, {}).empty());
    const auto merged = merger.Merge({});
    ASSERT_TRUE(merged.has_value()) << ToString(merged.error());
    EXPECT_EQ(ReadAll(merger).maps.size(), 30u);
    EXPECT_EQ(merger.ChangedSince(0).size(), 30u);
  }
  EXPECT_GE(merger.forgotten(), 4u);
}

TEST(MergerTest, ALayerOfTenThousandCellsMerges) {
  std::mt19937_64 rng(25);
  TraversabilityMap map;
  map.layers.push_back({Grid(10'000, 2), 50'000, 0, 0});
  for (Cell& cell : map.layers[0].grid.cells) cell = static_cast<Cell>(rng() % 3);
  World world;
  world.maps.push_back({*MakeLocalMap(MapKey(1, 1), 1, map, {}), Pose::FromPlanar(3, 1, 0)});
  EXPECT_EQ(CountDifferences(MergeBy(MakeCpu(), world), MergeByBruteForce(world)), 0u);
}

TEST(MergerTest, TenThousandMapsInOnePlaceMerge) {
  Merger merger({}, MakeCpu());
  TraversabilityMap map;
  map.node = {1, 1};
  for (int level = 0; level < 4; ++level) map.layers.push_back({Grid(8, 8), 50'000u << level, 0, 0});
  std::mt19937_64 rng(24);
  for (std::uint64_t i = 0; i < 10'000; ++i) {
    for (MapLayer& layer : map.layers) {
      for (Cell& cell : layer.grid.cells) cell = rng() % 500 == 0 ? Cell::kHazard : Cell::kUnknown;
    }
    ASSERT_TRUE(merger.Put({*MakeLocalMap(MapKey(1, i + 1), static_cast<std::int64_t>(i), map, {}), Pose{}}));
  }
  ASSERT_TRUE(merger.Merge({}));
  const MergeResult merged = ReadAll(merger);
  EXPECT_GT(merged.maps.size(), 20u);
  EXPECT_EQ(merger.map_count(), 10'000u);
}

}  // namespace
}  // namespace moondb
