#include "apps/moondb_mission/drive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "model/geometry.h"

namespace moondb {
namespace {

// Returns true if a rover's body (0.75 m x 0.5 m) at this pose covers no hazard cell.
bool IsBodySafe(const Terrain& terrain, const Eigen::Vector2d& position_m, double yaw_rad) {
  const Pose pose = Pose::FromPlanar(position_m.x(), position_m.y(), yaw_rad);
  for (double x = -0.375; x <= 0.376; x += 0.025) {
    for (double y = -0.25; y <= 0.251; y += 0.025) {
      if (terrain.IsHazard((pose * Eigen::Vector3d(x, y, 0)).head<2>())) return false;
    }
  }
  return true;
}

class DriveTest : public testing::TestWithParam<std::uint64_t> {};

TEST_P(DriveTest, RoversKeepApartAndOffHazardsAndExplore) {
  SCOPED_TRACE(GetParam());
  Random random(GetParam());
  const Terrain terrain = Terrain::Make(TerrainOptions(), random);
  DriveOptions options;
  options.rover_count = GetParam() % 2 == 0 ? 3 : 5;
  const auto tracks = DriveTeam(terrain, options, random);
  ASSERT_EQ(tracks.size(), static_cast<std::size_t>(options.rover_count));
  for (std::size_t rover = 0; rover < tracks.size(); ++rover) {
    ASSERT_EQ(tracks[rover].size(), static_cast<std::size_t>(options.node_count));
    double driven_m = 0;
    int steps = 0;
    for (std::size_t node = 1; node < tracks[rover].size(); ++node) {
      const TrackPoint& from = tracks[rover][node - 1];
      const TrackPoint& to = tracks[rover][node];
      const double step_m = (to.position_m - from.position_m).norm();
      EXPECT_LE(step_m, options.step_max_m + 1e-9);
      EXPECT_NEAR(std::remainder(from.yaw_rad + from.turn_rad - to.yaw_rad, 2 * M_PI), 0, 1e-9);
      driven_m += step_m;
      steps += step_m > 0;
      for (int part = 0; part <= 10; ++part) {
        const Eigen::Vector2d position = from.position_m + (to.position_m - from.position_m) * (part / 10.0);
        EXPECT_TRUE(IsBodySafe(terrain, position, to.yaw_rad));
      }
      // A turn on the spot passes through all headings between its start and its end.
      for (int part = 0; part <= 10; ++part) {
        EXPECT_TRUE(IsBodySafe(terrain, from.position_m, from.yaw_rad + from.turn_rad * part / 10.0));
      }
      for (std::size_t other = rover + 1; other < tracks.size(); ++other) {
        EXPECT_GE(LeastDistance(from.position_m, to.position_m, tracks[other][node - 1].position_m,
                                tracks[other][node].position_m),
                  options.separation_m - 1e-9);
      }
    }
    EXPECT_GT(steps, 0.8 * options.node_count);
    EXPECT_GT(driven_m, 0.4 * options.node_count);
    EXPECT_GT((tracks[rover].back().position_m - tracks[rover].front().position_m).norm(), 0.5);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, DriveTest, testing::Values(1, 2, 3, 4));

TEST(CrowdedDriveTest, RoversWaitRatherThanComeTooNear) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    TerrainOptions terrain_options;
    terrain_options.side_m = 15;
    terrain_options.crater_share = 0.3;
    Random random(seed);
    const Terrain terrain = Terrain::Make(terrain_options, random);
    DriveOptions options;
    options.rover_count = 8;
    const auto tracks = DriveTeam(terrain, options, random);
    double least_m = 1e9;
    int steps = 0;
    for (std::size_t a = 0; a < tracks.size(); ++a) {
      for (std::size_t node = 1; node < tracks[a].size(); ++node) {
        steps += tracks[a][node].position_m != tracks[a][node - 1].position_m;
        for (std::size_t b = a + 1; b < tracks.size(); ++b) {
          least_m = std::min(least_m, LeastDistance(tracks[a][node - 1].position_m, tracks[a][node].position_m,
                                                    tracks[b][node - 1].position_m, tracks[b][node].position_m));
        }
      }
    }
    EXPECT_GE(least_m, options.separation_m - 1e-9);
    EXPECT_LT(least_m, options.separation_m + 0.5);  // Some rovers come close to the limit, so waiting is tested.
    EXPECT_GT(steps, 100);
  }
}

TEST(LeastDistanceTest, FindsTheInstantBetweenNodes) {
  // Two rovers meet halfway, although the ends of their paths are far apart.
  EXPECT_NEAR(LeastDistance({-1, 0}, {1, 0}, {0, -1}, {0, 1}), 0, 1e-12);
  EXPECT_NEAR(LeastDistance({0, 0}, {0, 0}, {-2, 1}, {2, 1}), 1, 1e-12);
  EXPECT_NEAR(LeastDistance({0, 0}, {5, 0}, {0, 3}, {5, 3}), 3, 1e-12);
}

}  // namespace
}  // namespace moondb
