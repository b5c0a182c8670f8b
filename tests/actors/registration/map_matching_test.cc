#include "actors/registration/map_matching.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr MatchWindow kWide = {3, 15 * kDegree};

HazardField FieldOf(const TraversabilityMap& map) { return HazardField(map, {}); }

PlanarOffset OffsetOf(const Pose& first, const Pose& second) { return PlanarOffset::From(first.Inverse() * second); }

PlanarOffset Moved(PlanarOffset offset, double x_m, double y_m, double yaw_rad) {
  return {offset.x_m + x_m, offset.y_m + y_m, offset.yaw_rad + yaw_rad};
}

TEST(MapMatchingTest, FindsTheTrueOffsetOfTwoMapsWithinTheWindow) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const HazardWorld world = HazardWorld::OfRocks(seed, 80);
    const Pose first = Pose::FromPlanar(-0.5, 0.2, 0.3);
    const Pose second = Pose::FromPlanar(1.1, 0.9, -0.8);
    const PlanarOffset truth = OffsetOf(first, second);
    const MatchResult match = MatchMaps(FieldOf(world.MapAt(first)), FieldOf(world.MapAt(second)),
                                        Moved(truth, 1.7, -2.2, 9 * kDegree), kWide);
    ASSERT_EQ(match.verdict, MatchVerdict::kAccepted) << ToString(match.verdict);
    EXPECT_NEAR(match.first_from_second.x_m, truth.x_m, 0.03);
    EXPECT_NEAR(match.first_from_second.y_m, truth.y_m, 0.03);
    EXPECT_NEAR(match.first_from_second.yaw_rad, truth.yaw_rad, 0.3 * kDegree);
    EXPECT_GT(match.matched, 0.9);
    EXPECT_LT(match.second_best, 0.9);
  }
}

TEST(MapMatchingTest, SwappedMapsGiveTheInverseOffset) {
  const HazardWorld world = HazardWorld::OfRocks(3, 80);
  const Pose first = Pose::FromPlanar(0, 0, 0.3);
  const Pose second = Pose::FromPlanar(1, 0.5, -0.2);
  const HazardField a = FieldOf(world.MapAt(first));
  const HazardField b = FieldOf(world.MapAt(second));
  const MatchResult there = MatchMaps(a, b, Moved(OffsetOf(first, second), 0.5, 0, 0), kWide);
  const MatchResult back = MatchMaps(b, a, Moved(OffsetOf(second, first), 0, 0.5, 0), kWide);
  ASSERT_EQ(there.verdict, MatchVerdict::kAccepted);
  ASSERT_EQ(back.verdict, MatchVerdict::kAccepted);
  const Pose cycle = there.first_from_second.ToPose() * back.first_from_second.ToPose();
  EXPECT_LT(cycle.position_m.norm(), 0.02);
  EXPECT_LT(std::abs(cycle.Yaw()), 0.2 * kDegree);
}

TEST(MapMatchingTest, PointsOutsideTheOtherMapCountNeitherAsSeenNorAsMatched) {
  const HazardWorld world = HazardWorld::OfRocks(9, 120);
  const auto small_map_at = [&world](const Pose& pose) {
    TraversabilityMap map;
    map.layers = {world.LayerAt(pose, 50'000, 100)};
    return FieldOf(map);
  };
  const Pose second = Pose::FromPlanar(2.5, 0, 0);  // Half of each map lies outside the other one.
  const MatchResult match = MatchMaps(small_map_at({}), small_map_at(second), {2.5, 0, 0}, {0.6, 0.07});
  EXPECT_LT(match.overlap, 0.7);
  EXPECT_GT(match.overlap, 0.3);
}

TEST(MapMatchingTest, ACorridorIsRefusedBecauseItFitsElsewhere) {
  HazardWorld world;
  world.walls = {{{-30, -1}, {30, -1}}, {{-30, 1}, {30, 1}}};
  const MatchResult match =
      MatchMaps(FieldOf(world.MapAt({})), FieldOf(world.MapAt(Pose::FromPlanar(0.7, 0.1, 0.1))), {0.5, 0, 0}, kWide);
  EXPECT_EQ(match.verdict, MatchVerdict::kSecondPlace) << ToString(match.verdict);
}

TEST(MapMatchingTest, EqualRocksInRowsAreRefusedBecauseTheyFitElsewhere) {
  HazardWorld world;
  for (int x = -12; x <= 12; ++x) {
    for (int y = -12; y <= 12; ++y) world.rocks.push_back({{1.5 * x, 1.5 * y}, 0.3});
  }
  const MatchResult match =
      MatchMaps(FieldOf(world.MapAt({})), FieldOf(world.MapAt(Pose::FromPlanar(0.4, 0.3, 0))), {0.4, 0.3, 0}, kWide);
  EXPECT_EQ(match.verdict, MatchVerdict::kSecondPlace) << ToString(match.verdict);
}

TEST(MapMatchingTest, MapsOfDifferentPlacesAreNotAccepted) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const MatchResult match = MatchMaps(FieldOf(HazardWorld::OfRocks(seed, 80).MapAt({})),
                                        FieldOf(HazardWorld::OfRocks(seed + 100, 80).MapAt({})), {}, kWide);
    EXPECT_NE(match.verdict, MatchVerdict::kAccepted) << "seed " << seed;
  }
}

TEST(MapMatchingTest, AMapMatchesItselfAtOffsetZero) {
  const HazardField field = FieldOf(HazardWorld::OfRocks(5, 80).MapAt({}));
  const MatchResult match = MatchMaps(field, field, {0.3, -0.2, 2 * kDegree}, kWide);
  ASSERT_EQ(match.verdict, MatchVerdict::kAccepted) << ToString(match.verdict);
  EXPECT_NEAR(match.first_from_second.x_m, 0, 0.01);
  EXPECT_NEAR(match.first_from_second.y_m, 0, 0.01);
  EXPECT_NEAR(match.matched, 1, 1e-9);
}

TEST(MapMatchingTest, MapsOfAllHazardsEmptyMapsAndMapsOfOneCellAreRefused) {
  const auto of = [](int side_cells, Cell fill) {
    TraversabilityMap map;
    MapLayer layer;
    layer.grid = Grid(side_cells, side_cells, fill);
    layer.resolution_um = 50'000;
    map.layers = {layer};
    return FieldOf(map);
  };
  const HazardField good = FieldOf(HazardWorld::OfRocks(6, 80).MapAt({}));
  for (const HazardField& bad : {of(100, Cell::kHazard), of(100, Cell::kFree), of(100, Cell::kUnknown),
                                 of(1, Cell::kHazard), FieldOf(TraversabilityMap{})}) {
    EXPECT_NE(MatchMaps(good, bad, {}, kWide).verdict, MatchVerdict::kAccepted);
    EXPECT_NE(MatchMaps(bad, good, {}, kWide).verdict, MatchVerdict::kAccepted);
    EXPECT_NE(MatchMaps(bad, bad, {}, kWide).verdict, MatchVerdict::kAccepted);
  }
}

TEST(MapMatchingTest, SparseGroundIsAcceptedWithASigmaOfAtLeast10Centimetres) {
  HazardWorld world;
  world.rocks = {{{1, 1}, 0.1}, {{-1, 0.4}, 0.08}, {{0.3, -1.2}, 0.06}};
  const Pose second = Pose::FromPlanar(0.3, 0.2, 0.1);
  const HazardField first = FieldOf(world.MapAt({}));
  ASSERT_LT(first.points_m().size(), 60u);
  ASSERT_GE(first.points_m().size(), 30u);
  const MatchResult match = MatchMaps(first, FieldOf(world.MapAt(second)), {}, {0.6, 10 * kDegree});
  ASSERT_EQ(match.verdict, MatchVerdict::kAccepted) << ToString(match.verdict);
  EXPECT_GE(match.covariance(0, 0), 0.01);
  EXPECT_NEAR(match.first_from_second.x_m, 0.3, 0.05);
}

TEST(MapMatchingTest, AnOffsetOutsideTheWindowIsRefused) {
  const HazardWorld world = HazardWorld::OfRocks(8, 80);
  const Pose second = Pose::FromPlanar(1, 0, 0);
  const MatchResult match = MatchMaps(FieldOf(world.MapAt({})), FieldOf(world.MapAt(second)), {0.2, 0, 0}, {0.6, 0.07});
  EXPECT_NE(match.verdict, MatchVerdict::kAccepted);
}

TEST(MapMatchingTest, TheCovarianceCoversTheErrorsOfMapsWithNoise) {
  int inside = 0;
  constexpr int kSeeds = 40;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    HazardWorld world = HazardWorld::OfRocks(seed, 60);
    HazardWorld noisy = world;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> error(0, 0.05);
    for (Rock& rock : noisy.rocks) rock.center_m += Eigen::Vector2d(error(random), error(random));
    const Pose second = Pose::FromPlanar(1.1, -0.4, 0.3);
    const PlanarOffset truth = PlanarOffset::From(second);
    const MatchResult match =
        MatchMaps(FieldOf(world.MapAt({})), FieldOf(noisy.MapAt(second)), Moved(truth, 0.3, 0.3, 0), kWide);
    ASSERT_EQ(match.verdict, MatchVerdict::kAccepted) << "seed " << seed << ": " << ToString(match.verdict);
    const Eigen::Vector3d off(match.first_from_second.x_m - truth.x_m, match.first_from_second.y_m - truth.y_m,
                              match.first_from_second.yaw_rad - truth.yaw_rad);
    const double squared = off.dot(match.covariance.inverse() * off);
    inside += squared < 7.81 ? 1 : 0;  // 95 % of a chi-square with three degrees of freedom.
  }
  EXPECT_GE(inside, kSeeds * 9 / 10);
}

}  // namespace
}  // namespace moondb
