#include "actors/merge/cleared_hazards.h"

#include <gtest/gtest.h>

#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

class ClearedHazardsTest : public testing::Test {
 protected:
  // Adds a map of 10 x 10 cells of one value, whose corner lies at (x_m, 0).
  void AddMap(AgentId agent, std::uint64_t seq, char cell, double x_m, std::int64_t timestamp_ns,
              bool is_suspect = false) {
    const TraversabilityMap map = DrawMap(std::vector<std::string>(10, std::string(10, cell)), 50'000, agent);
    ASSERT_TRUE(collection_.AddMap(MapKey(agent, seq), {timestamp_ns, is_suspect}, map));
    collection_.AddRawPose({{agent, 7, 30}, 1}, {agent, 1}, Pose::FromPlanar(x_m, 0, 0));
  }

  std::vector<ClearedHazards> Find() {
    const MapCollection::Selected everything = collection_.Select({});
    Merger merger(MergeGrid{}, backend_);
    (void)merger.Assign(everything.maps, everything.footprints);
    EXPECT_TRUE(merger.Merge({}));
    const auto found = FindClearedHazards(everything, merger, backend_, {});
    EXPECT_TRUE(found) << ToString(found.error());
    return found ? *found : std::vector<ClearedHazards>();
  }

  static MapCollection::Options WithoutFootprints() {
    MapCollection::Options options;
    options.without_footprint = {1, 2, 3};
    return options;
  }

  MapCollection collection_{WithoutFootprints()};
  std::shared_ptr<GatherBackend> backend_ = *CreateGatherBackend(MergeBackend::kCpu);
};

TEST_F(ClearedHazardsTest, FindsTheMapThatMakesTheOthersHazardsFree) {
  AddMap(1, 1, '#', 0, 100 * kSecond_ns);
  AddMap(2, 1, '.', 0.25, 200 * kSecond_ns);  // Covers half of the hazards, and is newer.
  const auto found = Find();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].agent, 2u);
  EXPECT_EQ(found[0].hazard_count, 100u);
  EXPECT_EQ(found[0].cell_count, 50u);
  EXPECT_EQ(found[0].from_ns, 200 * kSecond_ns);
  EXPECT_EQ(found[0].to_ns, 200 * kSecond_ns);
}

TEST_F(ClearedHazardsTest, FindsNothingForASmallShare) {
  AddMap(1, 1, '#', 0, 100 * kSecond_ns);
  AddMap(2, 1, '.', 0.4, 200 * kSecond_ns);  // 20 of 100 hazards.
  EXPECT_TRUE(Find().empty());
}

TEST_F(ClearedHazardsTest, FindsNothingInAnOlderMap) {
  AddMap(1, 1, '#', 0, 100 * kSecond_ns);
  AddMap(2, 1, '.', 0, 50 * kSecond_ns);
  EXPECT_TRUE(Find().empty());
}

TEST_F(ClearedHazardsTest, FindsNothingInAnAgentsOwnHazards) {
  AddMap(1, 1, '#', 0, 100 * kSecond_ns);
  AddMap(1, 2, '.', 0, 200 * kSecond_ns);
  AddMap(2, 1, '.', 5, 200 * kSecond_ns);
  EXPECT_TRUE(Find().empty());
}

}  // namespace
}  // namespace moondb
