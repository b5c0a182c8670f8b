#include "apps/moondb_mission/terrain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace moondb {
namespace {

TerrainOptions WideOptions() {
  TerrainOptions options;
  options.side_m = 100;
  options.landing_radius_m = 0;
  options.base_radius_m = 0;
  return options;
}

double Area(const TerrainOptions& options) { return std::pow(options.side_m + 2 * options.margin_m, 2); }

TEST(TerrainTest, RocksCoverTheShareOfGolombekAndRapp) {
  for (const double share : {0.02, 0.05}) {
    SCOPED_TRACE(share);
    TerrainOptions options = WideOptions();
    options.rock_area_share = share;
    Random random(11);
    const Terrain terrain = Terrain::Make(options, random);
    const double decay = 1.79 + 0.152 / share;
    for (const double diameter_m : {0.1, 0.2, 0.3}) {
      double covered_m2 = 0;
      for (const Rock& rock : terrain.rocks()) {
        if (rock.diameter_m >= diameter_m) covered_m2 += std::numbers::pi / 4 * rock.diameter_m * rock.diameter_m;
      }
      const double expected = share * (std::exp(-decay * diameter_m) - std::exp(-decay * options.rock_diameter_max_m));
      EXPECT_NEAR(covered_m2 / Area(options), expected, 0.12 * expected) << diameter_m;
    }
  }
}

TEST(TerrainTest, RockNumbersFollowFromTheLaw) {
  const TerrainOptions options = WideOptions();
  Random random(12);
  const Terrain terrain = Terrain::Make(options, random);
  for (const double diameter_m : {0.1, 0.15, 0.25, 0.4}) {
    double count = 0;
    for (const Rock& rock : terrain.rocks()) count += rock.diameter_m >= diameter_m;
    const double expected = RocksPerSquareMetre(options, diameter_m) * Area(options);
    EXPECT_NEAR(count, expected, 4 * std::sqrt(expected)) << diameter_m;
  }
}

TEST(TerrainTest, CratersFollowTheEquilibriumLaw) {
  const TerrainOptions options = WideOptions();
  Random random(13);
  const Terrain terrain = Terrain::Make(options, random);
  for (const double diameter_m : {1.0, 2.0, 4.0}) {
    double count = 0;
    for (const Crater& crater : terrain.craters()) count += crater.diameter_m >= diameter_m;
    const double most = options.crater_diameter_max_m;
    const double expected = std::pow(10, -1.1) * (1 / (diameter_m * diameter_m) - 1 / (most * most)) * Area(options);
    EXPECT_NEAR(count, expected, 4 * std::sqrt(expected)) << diameter_m;
    for (const Crater& crater : terrain.craters()) EXPECT_LE(crater.depth_m, 0.2 * crater.diameter_m);
  }
}

TEST(TerrainTest, HighRocksAreHazardsAndLowOnesAreNot) {
  TerrainOptions options;
  options.crater_share = 0;
  Random random(14);
  const Terrain terrain = Terrain::Make(options, random);
  int hazards = 0;
  for (const Rock& rock : terrain.rocks()) {
    if (rock.height_m < options.hazard_height_m) continue;
    ++hazards;
    EXPECT_TRUE(terrain.IsHazard(rock.center_m));
    EXPECT_NEAR(terrain.SurfaceM(rock.center_m) - terrain.GroundM(rock.center_m), rock.height_m, 0.25 * rock.height_m);
  }
  EXPECT_GT(hazards, 20);
  // The area of the hazard cells is about the area of high rocks in the rock model. Low rocks are no hazards.
  const MergedMap map = terrain.HazardMap();
  double hazard_cells = 0;
  for (const Cell cell : map.grid.cells) hazard_cells += cell == Cell::kHazard;
  const double decay = 1.79 + 0.152 / options.rock_area_share;
  const double share = options.rock_area_share * std::exp(-decay * 2 * options.hazard_height_m);
  EXPECT_NEAR(hazard_cells / map.grid.cells.size(), share, 0.4 * share);
}

TEST(TerrainTest, OnlySteepCratersAreHazards) {
  TerrainOptions options;
  options.rock_area_share = 0.005;
  Random random(15);
  const Terrain terrain = Terrain::Make(options, random);
  int steep = 0, gentle = 0;
  for (const Crater& crater : terrain.craters()) {
    // A crater is steepest inside its rim, 0.45 diameters from the centre. The slope there is
    // 4 depth / diameter * (1 + rim).
    if (crater.diameter_m < 3 || crater.center_m.cwiseAbs().maxCoeff() > 15) continue;
    int around = 0;
    for (int i = 0; i < 36; ++i) {
      const double angle = i * std::numbers::pi / 18;
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      around += terrain.IsHazard(crater.center_m + 0.45 * crater.diameter_m * direction);
    }
    if (crater.depth_m > 0.13 * crater.diameter_m) {
      EXPECT_GT(around, 20);
      ++steep;
    }
    if (crater.depth_m < 0.05 * crater.diameter_m) {
      EXPECT_LT(around, 18);
      ++gentle;
    }
  }
  EXPECT_GT(gentle, 0);
  RecordProperty("steep_craters", steep);
}

TEST(TerrainTest, LandingGroundIsClearButForTheLander) {
  TerrainOptions options;
  options.base_m = {1, -1};
  Random random(16);
  const Terrain terrain = Terrain::Make(options, random);
  EXPECT_TRUE(terrain.IsHazard(options.base_m));
  for (double radius_m = 1; radius_m < 4.5; radius_m += 0.1) {
    for (int i = 0; i < 36; ++i) {
      const double angle = i * std::numbers::pi / 18;
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      EXPECT_FALSE(terrain.IsHazard(options.base_m + radius_m * direction));
    }
  }
}

}  // namespace
}  // namespace moondb
