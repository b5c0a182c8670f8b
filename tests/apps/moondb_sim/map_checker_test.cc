#include "apps/moondb_sim/map_checker.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

constexpr StreamKey kMaps{1, 5, proto::LOCAL_TRAVERSABILITY_MAP};
constexpr StreamKey kPowers{1, 5, proto::POWER};

HaveSet Maps(std::uint64_t last) {
  HaveSet have;
  have[kMaps].held.Add({1, last});
  return have;
}

proto::MergeReply Merged(std::uint32_t width_cells) {
  proto::MergeReply reply;
  reply.set_width_cells(width_cells);
  return reply;
}

TEST(MapCheckerTest, EqualRecordsGiveEqualMaps) {
  MapChecker checker;
  EXPECT_EQ(checker.OnMap(1, Maps(3), {}, Merged(10)), std::nullopt);
  EXPECT_EQ(checker.OnMap(2, Maps(3), {}, Merged(10)), std::nullopt);
  EXPECT_EQ(checker.OnMap(2, Maps(4), {}, Merged(11)), std::nullopt);
  EXPECT_NE(checker.OnMap(3, Maps(4), {}, Merged(10)), std::nullopt);
}

TEST(MapCheckerTest, OtherRecordsAndDroppedRecordsMakeNoDifference) {
  MapChecker checker;
  ASSERT_EQ(checker.OnMap(1, Maps(3), {}, Merged(10)), std::nullopt);
  HaveSet have = Maps(3);
  have[kPowers].held.Add(1);
  have[kMaps].dropped.Add(4);
  EXPECT_NE(checker.OnMap(1, have, {}, Merged(11)), std::nullopt);
}

TEST(MapCheckerTest, MapsAtRawPosesAreComparedSeparately) {
  MapChecker checker;
  proto::MergeRequest raw;
  raw.set_use_raw_poses(true);
  ASSERT_EQ(checker.OnMap(1, Maps(3), {}, Merged(10)), std::nullopt);
  EXPECT_EQ(checker.OnMap(1, Maps(3), raw, Merged(11)), std::nullopt);
}

// The tiles have two cells per side, and the left tile has a negative coordinate.
TEST(MapCheckerTest, TilesAreTheMap) {
  MergedMap merged;
  merged.grid = Grid(3, 1);
  merged.origin_cell_x = -2;
  merged.grid.cells = {Cell::kFree, Cell::kUnknown, Cell::kHazard};
  Grid left(2, 2);
  left.At(0, 0) = Cell::kFree;
  Grid right(2, 2);
  right.At(0, 0) = Cell::kHazard;
  EXPECT_EQ(WhyOther({{{-1, 0}, left}, {{0, 0}, right}}, merged), std::nullopt);
  EXPECT_NE(WhyOther({{{-1, 0}, left}}, merged), std::nullopt);
  EXPECT_NE(WhyOther({{{-1, 0}, right}, {{0, 0}, left}}, merged), std::nullopt);
  EXPECT_EQ(WhyOther({}, MergedMap()), std::nullopt);
}

}  // namespace
}  // namespace moondb::simulation
