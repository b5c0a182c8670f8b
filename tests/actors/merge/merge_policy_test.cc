// Tests the merge policy of the paper's Section 5.1 case by case, in worlds small enough to check by eye.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/merge_maps.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

using PolicyRows = std::vector<std::string>;

constexpr std::uint32_t kFine = 100'000;

class MergePolicyTest : public testing::Test {
 protected:
  void Put(AgentId agent, std::int64_t timestamp_ns, const PolicyRows& rows, std::uint32_t resolution_um = kFine) {
    const std::uint64_t seq = maps_.size() + 1;
    maps_.push_back({MapKey(agent, seq), timestamp_ns, Pose{}, DrawMap(rows, resolution_um, agent)});
  }

  PolicyRows Merge() {
    MergeOptions options;
    options.grid = grid_;
    options.backend = MergeBackend::kCpu;
    const Result<MergedMap> merged = MergeMaps(maps_, footprints_, options);
    EXPECT_TRUE(merged.has_value()) << ToString(merged.error());
    return merged ? Print(*merged) : PolicyRows{};
  }

  MergeGrid grid_{.resolution_um = kFine, .footprint_length_m = 0.2, .footprint_width_m = 0.1};
  std::vector<MapAtPose> maps_;
  std::vector<Pose> footprints_;
};

TEST_F(MergePolicyTest, TheEarlierOfTwoLayersOfOneResolutionDecides) {
  Put(1, 10, {"#"});
  TraversabilityMap second = DrawMap({".."}, kFine);
  maps_[0].map.layers.push_back(second.layers[0]);
  EXPECT_EQ(Merge(), (PolicyRows{"#."}));
}

TEST_F(MergePolicyTest, NeitherOrderNorRepetitionMatters) {
  constexpr std::uint64_t kSeed = 20'240'506;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  std::mt19937_64 rng(kSeed);
  for (int round = 0; round < 10; ++round) {
    World world = MakeRandomWorld(rng);
    const auto backend = std::make_shared<CpuGather>(CpuGather::Options{});
    const auto merge = [&] { return MergeBy(backend, world); };
    const MergeResult once = merge();
    for (int again = 0; again < 5; ++again) {
      world.maps.push_back(world.maps[rng() % world.maps.size()]);
      if (!world.footprints.empty()) world.footprints.push_back(world.footprints[0]);
      std::shuffle(world.maps.begin(), world.maps.end(), rng);
      std::shuffle(world.footprints.begin(), world.footprints.end(), rng);
      ASSERT_TRUE(merge() == once) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace moondb
