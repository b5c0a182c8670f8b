#include "actors/merge/gl_gather.h"

#include <gtest/gtest.h>

#include <iostream>
#include <random>
#include <thread>

#include "actors/merge/fallback_gather.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

// Skips its tests if this machine has no OpenGL driver.
class GlGatherTest : public testing::Test {
 protected:
  void SetUp() override {
    Result<std::unique_ptr<GlGather>> created = GlGather::Create({});
    if (!created) GTEST_SKIP() << ToString(created.error());
    gl_ = std::move(*created);
  }

  static void ExpectSame(const std::shared_ptr<GatherBackend>& gl, const World& world) {
    const auto cpu = std::make_shared<CpuGather>(CpuGather::Options{});
    EXPECT_EQ(CountDifferences(MergeBy(gl, world), MergeBy(cpu, world)), 0u);
  }

  static void ExpectSameInRandomWorlds(const std::shared_ptr<GatherBackend>& gl, std::uint64_t first_seed, int rounds) {
    std::mt19937_64 seeds(first_seed);
    for (int round = 0; round < rounds; ++round) {
      const std::uint64_t seed = seeds();
      SCOPED_TRACE(testing::Message() << "seed " << seed);
      std::mt19937_64 rng(seed);
      ExpectSame(gl, MakeRandomWorld(rng));
      if (HasFailure()) return;
    }
  }

  std::shared_ptr<GlGather> gl_;
};

TEST_F(GlGatherTest, NamesTheRenderer) {
  std::cout << gl_->description() << "\n";
  EXPECT_EQ(gl_->name(), "gl");
}

TEST_F(GlGatherTest, AgreesWithTheCpuInEveryCell) { ExpectSameInRandomWorlds(gl_, 100, 60); }

TEST_F(GlGatherTest, ATargetOfAFewTilesIsReused) {
  for (const int cells : {64, 130}) {
    const std::shared_ptr<GlGather> gl = *GlGather::Create({.target_cells_max = cells});
    ExpectSameInRandomWorlds(gl, 200, 8);
  }
}

// The texture's pages have the smallest size, so the texture is rebuilt repeatedly. Each rebuild drops withdrawn maps.
TEST_F(GlGatherTest, MapsMoveToALargerTexture) {
  const std::shared_ptr<GlGather> gl = *GlGather::Create({.atlas_page_texels_max = 512});
  ExpectSameInRandomWorlds(gl, 300, 15);
  std::mt19937_64 rng(301);
  World world = MakeRandomWorld(rng);
  for (std::uint64_t i = 0; i < 80; ++i) {
    TraversabilityMap map;
    map.layers.push_back({Grid(500, 500, Cell::kHazard), 10'000, 0, 0});
    map.layers[0].grid.At(150, static_cast<std::int32_t>(i)) = Cell::kUnknown;
    world.maps.push_back({*MakeLocalMap(MapKey(9, i + 1), 1, map, world.grid),
                          Pose::FromPlanar(world.maps[0].map_from_node.position_m.x() + 0.1 * static_cast<double>(i),
                                           world.maps[0].map_from_node.position_m.y(), 0.1)});
    if (i % 16 == 15) ExpectSame(gl, world);
  }
}

// Places 500 maps over one cell. A draw uses at most 63 of these maps per cell, so GlGather needs several draws.
TEST_F(GlGatherTest, GathersHundredsOfMapsOverOneCell) {
  World world;
  std::mt19937_64 rng(302);
  for (std::uint64_t i = 0; i < 500; ++i) {
    TraversabilityMap map;
    map.layers.push_back({Grid(100, 100), 50'000, 0, 0});
    for (int k = 0; k < 20; ++k) map.layers[0].grid.cells[rng() % 10'000] = Cell::kHazard;
    world.maps.push_back({*MakeLocalMap(MapKey(1, i + 1), static_cast<std::int64_t>(rng() % 9), map, {}),
                          Pose::FromPlanar(0, 0, 0.001 * static_cast<double>(i))});
  }
  ExpectSame(gl_, world);
}

TEST_F(GlGatherTest, GathersLayersMuchFinerThanTheGrid) {
  std::mt19937_64 rng(303);
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    ExpectSame(gl_, MakeFineWorld(rng));
  }
}

// Tile::blocks must contain only blocks that won a cell. When a map is withdrawn, Merger gathers again each tile whose
// `blocks` contains a block of that map.
TEST_F(GlGatherTest, ATileNamesOnlyBlocksThatWonACell) {
  std::vector<std::unique_ptr<PlacedThing>> things;
  for (const auto& [rows, timestamp_ns] : {std::pair{"#.", 3}, {"##", 2}, {"  ", 1}}) {
    const auto local = MakeLocalMap(MapKey(1, things.size() + 1), timestamp_ns, DrawMap({rows}, 50'000), {});
    things.push_back(*PlaceMap({*local, Pose{}}, {}));
  }
  std::vector<OrderedBlock> blocks;
  for (const std::unique_ptr<PlacedThing>& thing : things) {
    for (PlacedBlock& block : thing->blocks) blocks.push_back({block.rectangle.box, &block});
  }
  ASSERT_EQ(blocks.size(), 2u);
  CpuGather cpu({});
  for (GatherBackend* backend : {static_cast<GatherBackend*>(gl_.get()), static_cast<GatherBackend*>(&cpu)}) {
    SCOPED_TRACE(backend->name());
    Page page;
    GatherWork work{{0, 0}, &page, UINT16_MAX, 0};
    ASSERT_TRUE(backend->Gather(blocks, std::span(&work, 1), {}).has_value());
    EXPECT_EQ(work.changed, 1);
    ASSERT_NE(page.tiles[0], nullptr);
    EXPECT_EQ(page.tiles[0]->blocks, (std::vector<const PlacedBlock*>{blocks[0].block}));
    EXPECT_EQ(page.tiles[1], nullptr);
    work.changed = 0;
    ASSERT_TRUE(backend->Gather(blocks, std::span(&work, 1), {}).has_value());
    EXPECT_EQ(work.changed, 0);
  }
}

TEST_F(GlGatherTest, AnEmptyWorldMergesToAnEmptyMap) { ExpectSame(gl_, {}); }

TEST_F(GlGatherTest, AnyThreadMayUseItOneAtATime) {
  std::thread([this] { ExpectSameInRandomWorlds(gl_, 400, 2); }).join();
  ExpectSameInRandomWorlds(gl_, 401, 2);
}

// The OpenGL context is lost after `survived` draws of a merge. The CPU completes that merge. Later merges use a new
// context.
TEST_F(GlGatherTest, ALostContextInTheMiddleOfAMergeChangesNoCell) {
  int draws_left = 0;
  int contexts = 0;
  const auto make = [&]() -> Result<std::unique_ptr<GatherBackend>> {
    ++contexts;
    return GlGather::Create({.target_cells_max = 64, .is_lost = [&draws_left] { return --draws_left < 0; }});
  };
  std::mt19937_64 rng(500);
  const World world = MakeRandomWorld(rng);
  const MergeResult expected = MergeByBruteForce(world);
  for (const int survived : {0, 1, 5}) {
    SCOPED_TRACE(survived);
    draws_left = 1'000'000;
    contexts = 0;
    const auto backend = std::make_shared<FallbackGather>(*make(), make, 1);
    Merger merger(world.grid, backend);
    EXPECT_TRUE(merger.Assign(world.maps, world.footprints).empty());
    draws_left = survived;
    ASSERT_TRUE(merger.Merge({}).has_value());
    EXPECT_EQ(CountDifferences(ReadAll(merger), expected), 0u);
    EXPECT_EQ(backend->name(), "cpu");
    EXPECT_NE(backend->description().find("lost"), std::string::npos) << backend->description();
    draws_left = 1'000'000;
    EXPECT_TRUE(merger.Withdraw(world.maps[0].map->key));
    ASSERT_TRUE(merger.Merge({}).has_value());
    ASSERT_TRUE(merger.Put(world.maps[0]));
    ASSERT_TRUE(merger.Merge({}).has_value());
    EXPECT_EQ(CountDifferences(ReadAll(merger), expected), 0u);
    EXPECT_EQ(backend->name(), "gl");
    EXPECT_EQ(contexts, 2);
  }
}

}  // namespace
}  // namespace moondb
