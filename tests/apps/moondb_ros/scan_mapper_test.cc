#include "apps/moondb_ros/scan_mapper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

class ScanMapperTest : public testing::Test {
 protected:
  ScanMapperTest() {
    (void)frames_.Add(TransformAt(0, "base_link", "laser", Pose()), true);
    for (int i = 0; i <= 100; ++i) (void)track_.Add(OdometryAt(i * 0.05, Pose()));
  }

  PlannedNode NodeAt(double seconds) const { return {At(seconds), *track_.PoseAt(At(seconds)), false}; }
  // The cell of the finest layer at a place in the node's frame.
  static Cell CellAt(const TraversabilityMap& map, double x_m, double y_m) {
    return map.layers[0].grid.At(static_cast<std::int32_t>(std::floor(x_m / 0.05)) + 50,
                                 static_cast<std::int32_t>(std::floor(y_m / 0.05)) + 50);
  }

  OdometryTrack track_;
  FrameTree frames_;
  ScanMapper scans_;
};

TEST_F(ScanMapperTest, SeesAWallAroundTheRobot) {
  ASSERT_TRUE(scans_.Add(ScanAt(2, 1.52F)));
  const Result<TraversabilityMap> map = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_TRUE(map) << map.error().text;
  ASSERT_EQ(map->layers.size(), 4u);
  EXPECT_EQ(map->layers[0].resolution_um, 50'000u);
  EXPECT_EQ(map->layers[3].resolution_um, 400'000u);
  EXPECT_EQ(CellAt(*map, 0.5, 0.5), Cell::kFree);
  EXPECT_EQ(CellAt(*map, 1.51, 0.01), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, -0.01, -1.51), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, 1.6, 0), Cell::kUnknown);
  EXPECT_EQ(CellAt(*map, 2.4, 2.4), Cell::kUnknown);
}

TEST_F(ScanMapperTest, PlacesTheScannerOnTheRobot) {
  ASSERT_TRUE(frames_.Add(TransformAt(0, "base_link", "laser", Pose::FromPlanar(0.5, 0, 0)), true));
  ASSERT_TRUE(scans_.Add(ScanAt(2, 1.02F)));
  const Result<TraversabilityMap> map = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_TRUE(map);
  EXPECT_EQ(CellAt(*map, 1.51, 0.01), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, -0.51, 0.01), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, -0.6, 0.01), Cell::kUnknown);
}

TEST_F(ScanMapperTest, PlacesAScanWhereTheRobotWas) {
  OdometryTrack driving;
  Drive(driving, 0, 5);
  ASSERT_TRUE(scans_.Add(ScanAt(2, 2.02F)));
  const PlannedNode node{At(3), *driving.PoseAt(At(3)), false};
  const Result<TraversabilityMap> map = scans_.MapAt(node, driving, frames_);
  ASSERT_TRUE(map);
  // The robot was 1 m behind the node when it saw a wall 2.02 m ahead.
  EXPECT_EQ(CellAt(*map, 1.01, 0.01), Cell::kHazard);
}

TEST_F(ScanMapperTest, TurnsRaysOfASlowScanWithTheRobot) {
  OdometryTrack turning;
  for (int i = 0; i <= 100; ++i) (void)turning.Add(OdometryAt(i * 0.05, Pose::FromPlanar(0, 0, i * 0.05)));
  // One ray ahead at each instant: a scan of 1 s in a robot that turns by 1 rad in that time.
  RosScan scan = ScanAt(2, 2.02F, 101);
  scan.angle_min_rad = scan.angle_increment_rad = 0;
  scan.time_increment_s = 0.01;
  ASSERT_TRUE(scans_.Add(scan));
  const PlannedNode node{At(3), *turning.PoseAt(At(2)), false};
  const Result<TraversabilityMap> map = scans_.MapAt(node, turning, frames_);
  ASSERT_TRUE(map);
  EXPECT_EQ(CellAt(*map, 2.02 * std::cos(0.5), 2.02 * std::sin(0.5)), Cell::kHazard);
  EXPECT_EQ(CellAt(*map, 2.02 * std::cos(0.98), 2.02 * std::sin(0.98)), Cell::kHazard);
}

TEST_F(ScanMapperTest, InfiniteRangesAreFreeAndInvalidOnesAreSkipped) {
  RosScan scan = ScanAt(2, std::numeric_limits<float>::infinity());
  std::fill(scan.ranges_m.begin(), scan.ranges_m.begin() + 180, std::numeric_limits<float>::quiet_NaN());
  std::fill(scan.ranges_m.begin() + 180, scan.ranges_m.begin() + 360, 0.05F);  // Below range_min.
  ASSERT_TRUE(scans_.Add(scan));
  const Result<TraversabilityMap> map = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_TRUE(map);
  EXPECT_EQ(CellAt(*map, 1.5, 1.5), Cell::kFree);      // Rays from 0 to pi.
  EXPECT_EQ(CellAt(*map, 1.5, -1.5), Cell::kUnknown);  // Rays from -pi to 0.
  for (const MapLayer& layer : map->layers) {
    EXPECT_EQ(std::count(layer.grid.cells.begin(), layer.grid.cells.end(), Cell::kHazard), 0);
  }
}

TEST_F(ScanMapperTest, ACellThatMostRaysCrossIsFree) {
  // Two of three scans look through the place where the first one saw a person.
  ASSERT_TRUE(scans_.Add(ScanAt(1.5, 1.02F)));
  ASSERT_TRUE(scans_.Add(ScanAt(2, 2.02F)));
  ASSERT_TRUE(scans_.Add(ScanAt(2.5, 2.02F)));
  const Result<TraversabilityMap> map = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_TRUE(map);
  EXPECT_EQ(CellAt(*map, 1.01, 0.01), Cell::kFree);
  EXPECT_EQ(CellAt(*map, 2.01, 0.01), Cell::kHazard);
}

TEST_F(ScanMapperTest, UsesTheScansOfTwoSecondsAlone) {
  ASSERT_TRUE(scans_.Add(ScanAt(0.9, 1.02F)));
  ASSERT_TRUE(scans_.Add(ScanAt(3.1, 1.02F)));
  const Result<TraversabilityMap> none = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().text, "no scan was heard");
}

TEST_F(ScanMapperTest, NeedsATransform) {
  RosScan scan = ScanAt(2, 1);
  scan.frame = "other";
  ASSERT_TRUE(scans_.Add(scan));
  const Result<TraversabilityMap> none = scans_.MapAt(NodeAt(3), track_, frames_);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text.find("no transform"), std::string::npos);
}

TEST_F(ScanMapperTest, DropsWhatIsNoScan) {
  RosScan scan = ScanAt(2, 1);
  scan.angle_increment_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(scans_.Add(scan));
  scan = ScanAt(2, 1);
  scan.range_max_m = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(scans_.Add(scan));
  scan = ScanAt(2, 1);
  scan.ranges_m.resize(kRaysMax + 1);
  EXPECT_FALSE(scans_.Add(scan));
}

}  // namespace
}  // namespace moondb
