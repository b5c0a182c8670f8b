#include "actors/registration/submap_matching.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

// Returns a submap of three maps along the x axis of `map_from_submap`, `step_m` apart.
std::shared_ptr<const SubmapTemplate> SubmapAt(const HazardWorld& world, const PlanarOffset& map_from_submap,
                                               double step_m = 5) {
  std::vector<Submap::Source> sources;
  for (const double x_m : {-step_m, 0.0, step_m}) {
    const PlanarOffset submap_from_local = {x_m, 0, 0};
    TraversabilityMap map;
    map.layers = {world.LayerAt((map_from_submap * submap_from_local).ToPose(), 100'000, 100)};
    sources.push_back({std::move(map), submap_from_local, {}});
  }
  return std::make_shared<const SubmapTemplate>(std::make_shared<const Submap>(sources));
}

std::vector<SubmapPlace> Match(std::shared_ptr<const SubmapTemplate> first,
                               std::shared_ptr<const SubmapTemplate> second) {
  SubmapMatcher matcher;
  matcher.Begin(std::move(first), std::move(second));
  while (matcher.Step()) continue;
  return matcher.Finish();
}

void ExpectBestPlace(std::shared_ptr<const SubmapTemplate> first, std::shared_ptr<const SubmapTemplate> second,
                     const PlanarOffset& first_from_second) {
  const std::vector<SubmapPlace> places = Match(std::move(first), std::move(second));
  ASSERT_FALSE(places.empty());
  const PlanarOffset error = first_from_second.Inverse() * places[0].first_from_second;
  EXPECT_LT(error.position_m().norm(), 0.06);
  EXPECT_LT(std::abs(error.yaw_rad), 0.01);
  EXPECT_GT(places[0].evidence, 2);
}

TEST(SubmapMatcherTest, FindsTheSecondSubmapInRoomsAtAnyHeading) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  for (const double yaw_rad : {0.3, 1.5, 3.0, -2.0}) {
    SCOPED_TRACE(yaw_rad);
    const PlanarOffset first = {0, 0, 0.2};
    const PlanarOffset second = {3, 2, yaw_rad};
    ExpectBestPlace(SubmapAt(world, first), SubmapAt(world, second), first.Inverse() * second);
  }
}

TEST(SubmapMatcherTest, TriesAllRotationsAmongRocksWhereNoDirectionStandsOut) {
  const HazardWorld world = HazardWorld::OfRocks(2, 1000, 34);
  const auto first = SubmapAt(world, {0, 0, 0.2}, 0);
  const auto second = SubmapAt(world, {1, -1, 2.1}, 0);
  ASSERT_FALSE(first->has_direction());
  ExpectBestPlace(first, second, PlanarOffset{0, 0, 0.2}.Inverse() * PlanarOffset{1, -1, 2.1});
}

TEST(SubmapMatcherTest, ACorridorHasAlmostNoEvidence) {
  HazardWorld world;
  world.walls = {{{-50, 1.5}, {50, 1.5}}, {{-50, -1.5}, {50, -1.5}}};
  for (const SubmapPlace& place : Match(SubmapAt(world, {}), SubmapAt(world, {6, 0.2, 0}))) {
    EXPECT_LT(place.evidence, 0.5);
  }
}

TEST(SubmapOverlapTest, TwoLongWallsThatMeetHaveLittleEvidence) {
  HazardWorld world;
  world.walls = {{{-2, -40}, {-2, 2}}, {{-2, 2}, {40, 2}}};
  const auto submap = SubmapAt(world, {});
  const SubmapOverlap overlap = CompareSubmaps(submap->submap(), submap->submap(), {});
  EXPECT_EQ(overlap.Matched(), 1);
  EXPECT_GT(overlap.of[0].matched, 300);
  EXPECT_LT(overlap.Evidence(), 2);
}

TEST(SubmapMatcherTest, FindsNothingInFreeSpaceOrNoise) {
  EXPECT_TRUE(Match(SubmapAt({}, {}), SubmapAt({}, {})).empty());
  EXPECT_TRUE(Match(SubmapAt(HazardWorld::OfRooms(1), {}), SubmapAt({}, {})).empty());
  for (const SubmapPlace& place :
       Match(SubmapAt(HazardWorld::OfRooms(1), {}), SubmapAt(HazardWorld::OfRocks(9, 1500, 34), {}))) {
    EXPECT_LT(place.evidence, 3);
  }
}

TEST(SubmapOverlapTest, CountsWhatMatchesAndWhatContradicts) {
  const HazardWorld world = HazardWorld::OfRooms(4);
  const auto first = SubmapAt(world, {});
  const SubmapOverlap same = CompareSubmaps(first->submap(), first->submap(), {});
  EXPECT_EQ(same.Matched(), 1);
  EXPECT_EQ(same.Contradicted(), 0);
  EXPECT_GT(same.Evidence(), 1);
  const SubmapOverlap moved = CompareSubmaps(first->submap(), first->submap(), {1, 1, 0});
  EXPECT_LT(moved.Matched(), 0.5);
  EXPECT_GT(moved.Contradicted(), 0.3);
  EXPECT_LT(moved.Evidence(), 0);
}

}  // namespace
}  // namespace moondb
