// Checks that every backend (CPU with each instruction set, and GL) gives the same value, map and layer in every cell
// as NaiveMerger, whether it merges all maps at once or map by map.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <random>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/gl_gather.h"
#include "actors/merge/merge_maps.h"
#include "bench/naive_merger.h"
#include "model/mission.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

MergeResult MergeNaively(const World& world) {
  NaiveMerger naive(world.maps, world.footprints, world.grid);
  naive.Merge();
  MergeResult result;
  result.maps = naive.maps();
  result.merged.resolution_um = world.grid.resolution_um;
  const CellBox& extent = naive.extent();
  result.merged.grid = Grid(static_cast<std::int32_t>(extent.width()), static_cast<std::int32_t>(extent.height()));
  if (!extent.is_empty()) {
    result.merged.origin_cell_x = extent.first_x;
    result.merged.origin_cell_y = extent.first_y;
  }
  for (std::size_t i = 0; i < naive.cells().size(); ++i) {
    const NaiveMerger::CellState& state = naive.cells()[i];
    result.merged.grid.cells[i] = state.value;
    result.slots.push_back(state.map);
    result.levels.push_back(state.level);
  }
  return result;
}

// Leaves out items, because the world's pages exceed the limit.
MergeResult MergeInFewPages(const std::shared_ptr<GatherBackend>& backend, const World& world) {
  MergeGrid grid = world.grid;
  grid.pages_max = 3;
  Merger merger(grid, backend);
  merger.Assign(world.maps, world.footprints);
  EXPECT_TRUE(merger.Merge({}).has_value());
  return ReadAll(merger);
}

class MergeEqualityTest : public testing::Test {
 protected:
  MergeEqualityTest() {
    for (const GatherKernel* kernel : AvailableKernels()) {
      backends_.push_back(std::make_shared<CpuGather>(CpuGather::Options{2, kernel}));
    }
    if (Result<std::unique_ptr<GlGather>> gl = GlGather::Create({}); gl) backends_.push_back(std::move(*gl));
  }

  void ExpectSameItemsLeftOut(const World& world) {
    const MergeResult expected = MergeInFewPages(backends_.front(), world);
    for (const std::shared_ptr<GatherBackend>& backend : backends_) {
      EXPECT_EQ(CountDifferences(MergeInFewPages(backend, world), expected), 0u) << backend->description();
    }
  }

  void ExpectAllTheSame(const World& world) {
    const MergeResult expected = MergeNaively(world);
    for (const std::shared_ptr<GatherBackend>& backend : backends_) {
      EXPECT_EQ(CountDifferences(MergeBy(backend, world), expected), 0u) << backend->description();
      EXPECT_EQ(CountDifferences(MergeOneByOne(backend, world), expected), 0u) << backend->description();
    }
  }

  // First merges half of the maps at wrong poses. Then puts each map at its right pose, and merges after every few
  // maps.
  static MergeResult MergeOneByOne(const std::shared_ptr<GatherBackend>& backend, const World& world) {
    Merger merger(world.grid, backend);
    for (std::size_t i = 0; i < world.maps.size(); i += 2) {
      EXPECT_TRUE(merger.Put({world.maps[i].map, world.maps[world.maps.size() - 1 - i].map_from_node}));
    }
    EXPECT_TRUE(merger.Merge({}).has_value());
    const std::size_t step = std::max<std::size_t>(1, world.maps.size() / 20);
    for (std::size_t i = 0; i < world.maps.size(); ++i) {
      EXPECT_TRUE(merger.Put(world.maps[i]));
      if (i % step == 0) {
        EXPECT_TRUE(merger.Merge({}).has_value());
      }
    }
    for (const Footprint& footprint : world.footprints) EXPECT_TRUE(merger.PutFootprint(footprint));
    EXPECT_TRUE(merger.Merge({}).has_value());
    return ReadAll(merger);
  }

  void ExpectAllTheSameOnMission(const std::string& name) {
    const char* data = std::getenv("MOONDB_DATA");
    if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set";
    const Result<Mission> mission = ReadMission(std::filesystem::path(data) / name);
    ASSERT_TRUE(mission.has_value()) << ToString(mission.error());
    World world;
    for (const MissionMap& map : mission->maps) {
      Result<TraversabilityMap> grids = ReadMissionMap(*mission, map);
      ASSERT_TRUE(grids.has_value()) << ToString(grids.error());
      const auto local = MakeLocalMap(NumberedMapKey(map.agent, world.maps.size() + 1), map.timestamp_ns, *grids, {});
      ASSERT_TRUE(local.has_value());
      world.maps.push_back({*local, mission->truth.at(map.node)});
    }
    for (const auto& [node, pose] : mission->truth) world.footprints.push_back({node, pose});
    ExpectAllTheSame(world);
  }

  std::vector<std::shared_ptr<GatherBackend>> backends_;
};

// One in three of these worlds lies 1,000 km from the origin.
TEST_F(MergeEqualityTest, NoCellDiffersInRandomWorlds) {
  std::mt19937_64 seeds(7'000);
  for (int round = 0; round < 210; ++round) {
    const std::uint64_t seed = seeds();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    ExpectAllTheSame(world);
    ExpectSameItemsLeftOut(world);
    if (HasFailure()) return;
  }
}

TEST_F(MergeEqualityTest, NoCellDiffersOnIntelTeam) { ExpectAllTheSameOnMission("intel_team"); }
TEST_F(MergeEqualityTest, NoCellDiffersOnOrebroTeam) { ExpectAllTheSameOnMission("orebro_team"); }

}  // namespace
}  // namespace moondb
