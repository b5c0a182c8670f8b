#include "apps/moondb_ros/grid_mapper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

class GridMapperTest : public testing::Test {
 protected:
  GridMapperTest() {
    for (int i = 0; i <= 100; ++i) (void)track_.Add(OdometryAt(i * 0.05, Pose::FromPlanar(1, 0.5, 1.2)));
    (void)frames_.Add(TransformAt(0, "map", "odom", Pose::FromPlanar(10, 0, 0)), true);
  }

  PlannedNode Node() const { return {At(3), *track_.PoseAt(At(3)), false}; }
  static void Set(RosGrid& grid, double x_m, double y_m, std::int8_t value) {
    const auto column = static_cast<std::size_t>((x_m - grid.frame_from_origin.position_m.x()) / grid.resolution_m);
    const auto row = static_cast<std::size_t>((y_m - grid.frame_from_origin.position_m.y()) / grid.resolution_m);
    grid.values[row * grid.width + column] = value;
  }
  // The cell of a layer at a place in the frame of the grid.
  static Cell CellAt(const TraversabilityMap& map, std::size_t layer, const Eigen::Vector2d& center_m, double x_m,
                     double y_m) {
    const MapLayer& of = map.layers[layer];
    const Eigen::Vector2d corner = center_m + CornerOf(of);
    return of.grid.At(static_cast<std::int32_t>(std::floor((x_m - corner.x()) / of.resolution_m())),
                      static_cast<std::int32_t>(std::floor((y_m - corner.y()) / of.resolution_m())));
  }

  OdometryTrack track_;
  FrameTree frames_;
};

TEST_F(GridMapperTest, CutsTheCellsAroundTheRobot) {
  GridMapper grids(1);
  RosGrid grid = GridAt(2.5, "odom");
  Set(grid, 2.02, 0.52, 100);
  Set(grid, 0.02, 0.02, 0);
  Set(grid, 0.52, 0.52, 99);  // Inflation.
  ASSERT_TRUE(grids.Set(0, grid));
  const Result<TraversabilityMap> map = grids.MapAt(Node(), track_, frames_);
  ASSERT_TRUE(map) << map.error().text;
  const Eigen::Vector2d robot_m(1, 0.5);
  EXPECT_EQ(CellAt(*map, 0, robot_m, 2.02, 0.52), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, 0, robot_m, 0.02, 0.02), Cell::kFree);
  EXPECT_EQ(CellAt(*map, 0, robot_m, 0.52, 0.52), Cell::kUnknown);
  // The map's axes are those of the grid: the node has a yaw of 1.2 rad.
  EXPECT_NEAR(map->node_from_map.Yaw(), -1.2, 1e-9);
  EXPECT_NEAR(map->node_from_map.position_m.norm(), 0, 1e-9);
  // 10 m are within two layers: 5 m, and 10 m around a robot that is not in the middle, so a third one follows.
  ASSERT_EQ(map->layers.size(), 3u);
  EXPECT_EQ(map->layers[1].resolution_um, 100'000u);
  EXPECT_EQ(CellAt(*map, 1, robot_m, 2.02, 0.52), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, 2, robot_m, 0.02, 0.02), Cell::kFree);
}

TEST_F(GridMapperTest, ASmallGridGivesOneLayer) {
  GridMapper grids(1);
  RosGrid grid = GridAt(2.5, "base_link", 60);  // A local costmap of 3 x 3 m.
  ASSERT_TRUE(grids.Set(0, grid));
  const Result<TraversabilityMap> map = grids.MapAt(Node(), track_, frames_);
  ASSERT_TRUE(map) << map.error().text;
  EXPECT_EQ(map->layers.size(), 1u);
  EXPECT_NEAR(map->node_from_map.Yaw(), 0, 1e-9);
}

TEST_F(GridMapperTest, TakesAFrameThatTfJoinsToOdometry) {
  GridMapper grids(1);
  RosGrid grid = GridAt(2.5, "map", 600);
  Set(grid, 12.02, 0.52, 100);
  ASSERT_TRUE(grids.Set(0, grid));
  const Result<TraversabilityMap> map = grids.MapAt(Node(), track_, frames_);
  ASSERT_TRUE(map) << map.error().text;
  EXPECT_EQ(CellAt(*map, 0, Eigen::Vector2d(11, 0.5), 12.02, 0.52), Cell::kHazard);
  ASSERT_TRUE(grids.Set(0, GridAt(2.6, "elsewhere")));
  EXPECT_NE(grids.MapAt(Node(), track_, frames_).error().text.find("no transform joins its frame elsewhere"),
            std::string::npos);
}

TEST_F(GridMapperTest, PlacesAGridOnTheRobotWhereTheRobotWas) {
  OdometryTrack driving;
  Drive(driving, 0, 5);
  GridMapper grids(1);
  RosGrid grid = GridAt(2, "base_link", 200);
  Set(grid, 2.02, 0.02, 100);
  ASSERT_TRUE(grids.Set(0, grid));
  const PlannedNode node{At(3), *driving.PoseAt(At(3)), false};
  const Result<TraversabilityMap> map = grids.MapAt(node, driving, frames_);
  ASSERT_TRUE(map) << map.error().text;
  // The robot drove 1 m since the grid, so the hazard lies 1 m ahead of the node.
  const Eigen::Vector3d hazard_m = map->node_from_map * Eigen::Vector3d(1.02, 0.02, 0);
  EXPECT_NEAR(hazard_m.x(), 1.02, 1e-6);
  EXPECT_EQ(CellAt(*map, 0, Eigen::Vector2d(1, 0), 2.02, 0.02), Cell::kHazard);
}

TEST_F(GridMapperTest, DoesNotUseAGridFromBeforeAJump) {
  OdometryTrack jumping;
  Drive(jumping, 0, 2);
  ASSERT_TRUE(jumping.Add(OdometryAt(2.05, Pose::FromPlanar(50, 0, 0))));
  ASSERT_TRUE(jumping.Add(OdometryAt(4, Pose::FromPlanar(50, 0, 0))));
  GridMapper grids(1);
  ASSERT_TRUE(grids.Set(0, GridAt(1.5, "odom")));
  const PlannedNode node{At(3), *jumping.PoseAt(At(3)), true};
  EXPECT_EQ(grids.MapAt(node, jumping, frames_).error().text, "odometry jumped after its last grid");
}

TEST_F(GridMapperTest, SeveralTopicsGiveALayerEach) {
  GridMapper grids(2);
  RosGrid coarse = GridAt(2.5, "odom", 100);
  coarse.resolution_m = 0.2;
  coarse.frame_from_origin.position_m = {-10, -10, 0};
  ASSERT_TRUE(grids.Set(0, coarse));
  ASSERT_TRUE(grids.Set(1, GridAt(2.5, "odom")));
  const Result<TraversabilityMap> map = grids.MapAt(Node(), track_, frames_);
  ASSERT_TRUE(map);
  ASSERT_EQ(map->layers.size(), 2u);
  EXPECT_EQ(map->layers[0].resolution_um, 50'000u);
  EXPECT_EQ(map->layers[1].resolution_um, 200'000u);
  ASSERT_TRUE(grids.Set(1, GridAt(2.5, "map")));
  EXPECT_FALSE(grids.MapAt(Node(), track_, frames_));
}

TEST_F(GridMapperTest, DoesNotUseAnOldGrid) {
  GridMapper grids(1);
  ASSERT_TRUE(grids.Set(0, GridAt(3 - kGridAgeMax_s - 0.1, "odom")));
  EXPECT_EQ(grids.MapAt(Node(), track_, frames_).error().text, "no grid was heard in the last 15 s");
}

TEST_F(GridMapperTest, DropsWhatIsNoGrid) {
  GridMapper grids(1);
  const auto dropped = [&grids](const auto& change) {
    RosGrid grid = GridAt(2, "odom");
    change(grid);
    return !grids.Set(0, std::move(grid));
  };
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.frame_from_origin = Pose::FromPlanar(0, 0, 0.1); }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.values.pop_back(); }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.width = 0; }));
  EXPECT_TRUE(dropped([](RosGrid& grid) {
    grid.width = kGridSideMax_cells + 1;
    grid.height = 1;
    grid.values.assign(grid.width, 0);
  }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.resolution_m = 0.005; }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.resolution_m = std::nan(""); }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.values[7] = 101; }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.values[7] = -2; }));
  EXPECT_TRUE(dropped([](RosGrid& grid) { grid.frame_from_origin.position_m.x() = std::nan(""); }));
  EXPECT_FALSE(dropped([](RosGrid&) {}));
}

TEST_F(GridMapperTest, RefusesGridsThatNeverHaveAnUnknownCell) {
  GridMapper grids(1);
  RosGrid known = GridAt(2, "odom");
  std::ranges::fill(known.values, std::int8_t{0});
  for (int i = 1; i < GridMapper::kFullyKnownMax; ++i) ASSERT_TRUE(grids.Set(0, known));
  const Result<void> refused = grids.Set(0, known);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text.find("track_unknown_space: true"), std::string::npos);
  EXPECT_FALSE(grids.MapAt(Node(), track_, frames_));
  EXPECT_FALSE(grids.Set(0, known));
  EXPECT_TRUE(grids.Set(0, GridAt(2, "odom"))) << "one with unknown cells counts again";
  EXPECT_TRUE(grids.Set(0, known));
}

}  // namespace
}  // namespace moondb
