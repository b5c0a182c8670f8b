#include "actors/merge/cpu_gather.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

// Runs each kernel that this machine supports, with one to three threads.
TEST(CpuGatherTest, AgreesWithBruteForceInEveryCell) {
  std::mt19937_64 seeds(1);
  for (int round = 0; round < 40; ++round) {
    const std::uint64_t seed = seeds();
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    const MergeResult expected = MergeByBruteForce(world);
    for (const GatherKernel* kernel : AvailableKernels()) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << kernel->name);
      const int threads = 1 + round % 3;
      const auto backend = std::make_shared<CpuGather>(CpuGather::Options{threads, kernel});
      ASSERT_EQ(CountDifferences(MergeBy(backend, world), expected), 0u);
    }
  }
}

// Compares the merge with MergeByGeometry. Cells close to borders may differ because of rounding, and are not compared.
TEST(CpuGatherTest, AgreesWithGeometryAwayFromBorders) {
  std::mt19937_64 seeds(2);
  std::size_t certain = 0;
  std::size_t known = 0;
  for (int round = 0; round < 8; ++round) {
    const std::uint64_t seed = seeds();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    const MergeResult merged = MergeBy(std::make_shared<CpuGather>(CpuGather::Options{}), world);
    const CellBox extent{merged.merged.origin_cell_x, merged.merged.origin_cell_y,
                         merged.merged.origin_cell_x + merged.merged.grid.width - 1,
                         merged.merged.origin_cell_y + merged.merged.grid.height - 1};
    const GeometricMerge expected = MergeByGeometry(world, extent, 1e-3L);
    for (std::size_t i = 0; i < expected.cells.size(); ++i) {
      if (!expected.is_certain[i]) continue;
      ++certain;
      known += expected.cells[i] != Cell::kUnknown ? 1 : 0;
      ASSERT_EQ(merged.merged.grid.cells[i], expected.cells[i]) << "cell " << i;
    }
  }
  EXPECT_GT(certain, 100'000u);
  EXPECT_GT(known, 10'000u);
}

// The layers are up to 200 times finer than the merged map. An overflow of the fixed-point arithmetic would change
// cells.
TEST(CpuGatherTest, GathersLayersMuchFinerThanTheGrid) {
  std::mt19937_64 seeds(3);
  for (int round = 0; round < 12; ++round) {
    const std::uint64_t seed = seeds();
    std::mt19937_64 rng(seed);
    const World world = MakeFineWorld(rng);
    const MergeResult expected = MergeByBruteForce(world);
    for (const GatherKernel* kernel : AvailableKernels()) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << kernel->name);
      const auto backend = std::make_shared<CpuGather>(CpuGather::Options{1, kernel});
      ASSERT_EQ(CountDifferences(MergeBy(backend, world), expected), 0u);
    }
  }
}

TEST(CpuGatherTest, NamesItsKernel) {
  EXPECT_STREQ(AvailableKernels().front()->name, "scalar");
  const CpuGather gather({3, ScalarKernel()});
  EXPECT_EQ(gather.name(), "cpu");
  EXPECT_EQ(gather.description(), "cpu (scalar, 3 threads)");
}

TEST(CpuGatherTest, AMergeCanBeStopped) {
  std::mt19937_64 rng(3);
  const World world = MakeRandomWorld(rng);
  Merger merger(world.grid, std::make_shared<CpuGather>(CpuGather::Options{2}));
  merger.Assign(world.maps, world.footprints);
  const Result<MergeSummary> merged = merger.Merge([] { return true; });
  ASSERT_FALSE(merged.has_value());
  EXPECT_EQ(merged.error().code, ErrorCode::kUnavailable);
  ASSERT_TRUE(merger.Merge({}).has_value());
  EXPECT_EQ(CountDifferences(ReadAll(merger), MergeByBruteForce(world)), 0u) << "the next merge does the rest";
}

}  // namespace
}  // namespace moondb
