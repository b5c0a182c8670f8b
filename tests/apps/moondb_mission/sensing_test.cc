#include "apps/moondb_mission/sensing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace moondb {
namespace {

TerrainOptions FlatOptions() {
  TerrainOptions options;
  options.side_m = 40;
  options.crater_share = 0;
  // Only the largest rocks exist. landing_radius_m keeps them away from the lander.
  options.rock_diameter_min_m = 2.49;
  options.landing_radius_m = 25;
  return options;
}

CameraOptions PerfectCamera() {
  CameraOptions options;
  options.depth_error_per_m = 0;
  options.miss_share = options.false_share = options.phantom_share = 0;
  return options;
}

Cell CellAt(const TraversabilityMap& map, int layer, double x_m, double y_m) {
  const MapLayer& l = map.layers[layer];
  return l.grid.At(static_cast<int>(std::floor(x_m * 1e6 / l.resolution_um)) + l.grid.width / 2,
                   static_cast<int>(std::floor(y_m * 1e6 / l.resolution_um)) + l.grid.height / 2);
}

class SensingTest : public testing::Test {
 protected:
  SensingTest() : terrain_(Terrain::Make(FlatOptions(), random_)) {}
  Random random_{3};
  Terrain terrain_;
};

TEST_F(SensingTest, SeesTheLanderAndNothingBehindIt) {
  // The camera is 4 m from the lander's centre, and 3.2 m from its near side.
  const TraversabilityMap map = Sense(terrain_, {1, 0}, Pose::FromPlanar(-4.2, 0, 0), 0, {}, PerfectCamera(), random_);
  ASSERT_EQ(map.layers.size(), 4u);
  EXPECT_EQ(map.node, (NodeKey{1, 0}));
  EXPECT_EQ(map.node_from_map.position_m.x(), 0.2);
  EXPECT_EQ(CellAt(map, 0, 2.0, 0), Cell::kFree);
  EXPECT_EQ(CellAt(map, 1, 3.25, 0), Cell::kHazard);
  EXPECT_EQ(CellAt(map, 2, 6.0, 0), Cell::kUnknown);
  EXPECT_EQ(CellAt(map, 2, 6.0, 5.0), Cell::kFree);
  EXPECT_EQ(CellAt(map, 1, -2.0, 0), Cell::kUnknown);  // This cell is behind the camera.
}

TEST_F(SensingTest, TurningSweepsTheView) {
  const Pose pose = Pose::FromPlanar(-8, 0, 0);
  const TraversabilityMap still = Sense(terrain_, {1, 0}, pose, 0, {}, PerfectCamera(), random_);
  const TraversabilityMap turned = Sense(terrain_, {1, 0}, pose, 1.5, {}, PerfectCamera(), random_);
  EXPECT_EQ(CellAt(still, 0, -0.5, 2.0), Cell::kUnknown);
  EXPECT_EQ(CellAt(turned, 0, -0.5, 2.0), Cell::kFree);
  EXPECT_EQ(CellAt(turned, 0, -0.5, -2.0), Cell::kUnknown);
}

TEST_F(SensingTest, OtherRoversAreObstacles) {
  const Pose pose = Pose::FromPlanar(-10.2, 0, 0);
  const TraversabilityMap map = Sense(terrain_, {1, 0}, pose, 0, {{-8, 0}}, PerfectCamera(), random_);
  EXPECT_EQ(CellAt(map, 0, 1.7, 0), Cell::kHazard);
  EXPECT_EQ(CellAt(Sense(terrain_, {1, 0}, pose, 0, {}, PerfectCamera(), random_), 0, 1.7, 0), Cell::kFree);
}

TEST_F(SensingTest, ErrorGrowsWithDistance) {
  // Returns the standard deviation of the measured distances to the lander's near side.
  const auto spread_m = [this](double distance_m) {
    CameraOptions options = PerfectCamera();
    options.depth_error_per_m = 0.004;
    options.field_of_view_rad = 0.02;
    double sum = 0, squares = 0;
    int count = 0;
    for (int i = 0; i < 100; ++i) {
      const Pose pose = Pose::FromPlanar(-distance_m - 0.8 - options.ahead_m, 0, 0);
      const TraversabilityMap map = Sense(terrain_, {1, 0}, pose, 0, {}, options, random_);
      for (double x = 0.3; x < 12; x += 0.05) {
        if (CellAt(map, 2, x, 0) != Cell::kHazard) continue;
        sum += x, squares += x * x, ++count;
        break;
      }
    }
    EXPECT_GT(count, 75);
    return std::sqrt(std::max(0.0, squares / count - sum * sum / count / count));
  };
  EXPECT_LT(spread_m(2), 0.15);
  EXPECT_GT(spread_m(8), 0.2);
}

TEST_F(SensingTest, PhantomsAppearInTheirShareOfMaps) {
  CameraOptions options = PerfectCamera();
  options.phantom_share = 0.3;
  int with_hazard = 0;
  for (int i = 0; i < 100; ++i) {
    const TraversabilityMap map = Sense(terrain_, {1, 0}, Pose::FromPlanar(-14, 0, 3.1), 0, {}, options, random_);
    for (const Cell cell : map.layers[1].grid.cells) {
      if (cell != Cell::kHazard) continue;
      ++with_hazard;
      break;
    }
  }
  EXPECT_GT(with_hazard, 10);
  EXPECT_LT(with_hazard, 50);
}

}  // namespace
}  // namespace moondb
