#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "actors/merge/cpu_merger.h"
#include "actors/merge/gl_merger.h"
#include "actors/merge/merge_maps.h"
#include "model/mission.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

// Skips where this machine has no driver.
class GlMergerTest : public testing::Test {
 protected:
  void SetUp() override {
    Result<std::unique_ptr<GlMerger>> created = GlMerger::Create({});
    if (!created) GTEST_SKIP() << ToString(created.error());
    gl_ = std::move(*created);
  }

  static void ExpectSame(GlMerger& gl, const MapPlacement& placement) {
    const Result<MergeResult> expected = CpuMerger().Merge(placement);
    ASSERT_TRUE(expected.has_value());
    const Result<MergeResult> drawn = gl.Merge(placement);
    ASSERT_TRUE(drawn.has_value()) << ToString(drawn.error());
    std::size_t different = 0;
    for (std::size_t i = 0; i < expected->slots.size(); ++i) {
      different += expected->merged.grid.cells[i] != drawn->merged.grid.cells[i] ||
                           expected->slots[i] != drawn->slots[i] || expected->levels[i] != drawn->levels[i]
                       ? 1
                       : 0;
    }
    EXPECT_EQ(different, 0u) << "of " << expected->slots.size() << " cells";
    EXPECT_TRUE(*expected == *drawn);
  }

  static void ExpectSameInRandomWorlds(GlMerger& gl, std::uint64_t first_seed, int rounds) {
    std::mt19937_64 seeds(first_seed);
    for (int round = 0; round < rounds; ++round) {
      const std::uint64_t seed = seeds();
      SCOPED_TRACE(testing::Message() << "seed " << seed);
      std::mt19937_64 rng(seed);
      const World world = MakeRandomWorld(rng);
      const Result<MapPlacement> placement = PlaceMaps(world.maps, world.footprints, world.grid);
      ASSERT_TRUE(placement.has_value());
      ExpectSame(gl, *placement);
      if (HasFatalFailure()) return;
    }
  }

  std::unique_ptr<GlMerger> gl_;
};

TEST_F(GlMergerTest, SaysWhoDraws) {
  std::cout << gl_->description() << "\n";
  EXPECT_EQ(gl_->name(), "gl");
}

TEST_F(GlMergerTest, AgreesWithTheCpuInEveryCell) { ExpectSameInRandomWorlds(*gl_, 100, 60); }

TEST_F(GlMergerTest, TilesHaveNoSeams) {
  const auto gl = *GlMerger::Create({.tile_cells_max = 37});
  ExpectSameInRandomWorlds(*gl, 200, 15);
}

// Pages of the least size: the texture is made anew again and again, and withdrawn maps leave it.
TEST_F(GlMergerTest, MapsMoveToALargerTexture) {
  const auto gl = *GlMerger::Create({.atlas_page_cells_max = 512});
  ExpectSameInRandomWorlds(*gl, 300, 15);
  std::mt19937_64 rng(301);
  World world = MakeRandomWorld(rng);
  for (std::uint64_t i = 0; i < 40; ++i) {
    TraversabilityMap map;
    map.layers.push_back({Grid(300, 300, Cell::kHazard), 10'000, 0, 0});
    map.layers[0].grid.At(150, static_cast<std::int32_t>(i)) = Cell::kUnknown;
    world.maps.push_back({*MakeLocalMap(MapKey(9, i + 1), 1, map, world.grid),
                          Pose::FromPlanar(world.maps[0].map_from_node.position_m.x() + 0.1 * static_cast<double>(i),
                                           world.maps[0].map_from_node.position_m.y(), 0.1)});
    if (i % 8 != 7) continue;
    const Result<MapPlacement> placement = PlaceMaps(world.maps, world.footprints, world.grid);
    ASSERT_TRUE(placement.has_value());
    ExpectSame(*gl, *placement);
  }
}

TEST_F(GlMergerTest, NothingMergesToNothing) {
  const Result<MapPlacement> placement = PlaceMaps({}, {}, {});
  ASSERT_TRUE(placement.has_value());
  ExpectSame(*gl_, *placement);
}

TEST_F(GlMergerTest, AnyOneThreadAtATimeMayUseIt) {
  std::thread([this] { ExpectSameInRandomWorlds(*gl_, 400, 2); }).join();
  ExpectSameInRandomWorlds(*gl_, 401, 2);
}

TEST_F(GlMergerTest, AgreesWithTheCpuOnARecordedMission) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set";
  const Result<Mission> mission = ReadMission(std::filesystem::path(data) / "orebro_team");
  ASSERT_TRUE(mission.has_value()) << ToString(mission.error());
  std::vector<PlacedMap> maps;
  std::vector<Pose> footprints;
  for (const MissionMap& map : mission->maps) {
    Result<TraversabilityMap> grids = ReadMissionMap(*mission, map);
    ASSERT_TRUE(grids.has_value()) << ToString(grids.error());
    const auto local = MakeLocalMap(NumberedMapKey(map.agent, maps.size() + 1), map.stamp_ns, *grids, {});
    ASSERT_TRUE(local.has_value());
    maps.push_back({*local, mission->truth.at(map.node)});
  }
  for (const auto& [node, pose] : mission->truth) footprints.push_back(pose);
  const Result<MapPlacement> placement = PlaceMaps(maps, footprints, {});
  ASSERT_TRUE(placement.has_value()) << ToString(placement.error());
  ExpectSame(*gl_, *placement);
}

}  // namespace
}  // namespace moondb
