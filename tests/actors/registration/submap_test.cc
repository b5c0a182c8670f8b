#include "actors/registration/submap.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"
#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

// A straight track of nodes `step_m` apart, with a map at each node.
struct Drive {
  explicit Drive(int nodes, double step_m) {
    std::vector<RoverTrack::Step> steps;
    for (int i = 0; i < nodes; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const PlanarOffset pose = {i * step_m, 0, 0};
      steps.push_back({{1, index}, pose});
      maps.push_back({{{1, 7, proto::LOCAL_TRAVERSABILITY_MAP}, index + 1}, index, pose});
    }
    track = std::make_unique<RoverTrack>(steps);
  }
  std::unique_ptr<RoverTrack> track;
  std::vector<TrackMap> maps;
};

TEST(SubmapWindowTest, CoverFifteenMetresEachSevenAndAHalf) {
  const Drive drive(31, 1);  // 30 m.
  const std::vector<SubmapWindow> windows = FindWindows(*drive.track, drive.maps);
  ASSERT_EQ(windows.size(), 4u) << "0 to 15, 7.5 to 22.5, 15 to 30, and the end from 22.5 on";
  EXPECT_EQ(windows[3].maps.size(), 16u);
  EXPECT_EQ(windows[3].middle, 8u);
  EXPECT_EQ(windows[0].maps.size(), 8u);
}

TEST(SubmapWindowTest, FullOnesStayWhenTheRoverDrivesOn) {
  const Drive now(31, 1), later(45, 1);
  const std::vector<SubmapWindow> before = FindWindows(*now.track, now.maps);
  const std::vector<SubmapWindow> after = FindWindows(*later.track, later.maps);
  for (std::size_t i = 1; i < before.size(); ++i) {
    const SubmapWindow& window = after[after.size() - before.size() + i];
    EXPECT_EQ(window.hash, before[i].hash) << i;
    EXPECT_EQ(window.middle, before[i].middle) << i;
  }
}

TEST(SubmapWindowTest, AShortDriveIsOneWindowAndALongOneHasAtMost32) {
  const Drive brief(4, 1);
  EXPECT_EQ(FindWindows(*brief.track, brief.maps).size(), 1u);
  const Drive parked(50, 0);
  EXPECT_EQ(FindWindows(*parked.track, parked.maps).size(), 1u);
  EXPECT_LE(FindWindows(*parked.track, parked.maps)[0].maps.size(), 50u);
  const Drive slow(1500, 0.01);
  const std::vector<SubmapWindow> windows = FindWindows(*slow.track, slow.maps);
  EXPECT_EQ(windows[0].maps.size(), 64u);
  EXPECT_GT(windows[0].maps.back().index - windows[0].maps.front().index, 700u) << "evenly spread";
  const Drive far(1000, 1);
  EXPECT_LE(FindWindows(*far.track, far.maps).size(), 32u);
  EXPECT_TRUE(FindWindows(*far.track, {}).empty());
}

TEST(SubmapTest, IsAHazardWhereFourInTenMapsSayItAndFreeWhereAtMostFifteenInAHundredDo) {
  const auto submap_of = [](int hazards, int all) {
    std::vector<Submap::Source> sources;
    for (int i = 0; i < all; ++i) {
      TraversabilityMap map;
      map.layers.resize(1);
      map.layers[0].resolution_um = 100'000;
      map.layers[0].grid = Grid(40, 40, Cell::kFree);
      if (i < hazards) map.layers[0].grid.At(20, 20) = Cell::kHazard;
      sources.push_back({map, {}, {}});
    }
    return Submap(sources);
  };
  const auto is_known = [](const Submap& submap) { return submap.distances().At({0.05, 0.05}).is_known; };
  EXPECT_EQ(submap_of(4, 10).points().size(), 1u);
  EXPECT_TRUE(submap_of(3, 10).points().empty());
  EXPECT_FALSE(is_known(submap_of(3, 10)));
  EXPECT_TRUE(is_known(submap_of(3, 20)));
  EXPECT_TRUE(submap_of(3, 20).points().empty());
}

TEST(SubmapTest, TakesFineLayersOnlyWithoutOthersAndThenLosesNoHazard) {
  TraversabilityMap map;
  map.layers.resize(1);
  map.layers[0].resolution_um = 20'000;
  map.layers[0].grid = Grid(100, 100, Cell::kFree);
  map.layers[0].grid.At(7, 3) = Cell::kHazard;
  const std::vector<Submap::Source> fine = {{map, {}, {}}};
  EXPECT_EQ(Submap(fine).points().size(), 1u);
  MapLayer coarse;
  coarse.resolution_um = 200'000;
  coarse.grid = Grid(10, 10, Cell::kFree);
  map.layers.push_back(coarse);
  const std::vector<Submap::Source> both = {{map, {}, {}}};
  EXPECT_TRUE(Submap(both).points().empty());
}

TEST(SubmapTest, LeavesMaskedDiscsOutAndWhatIsFarFromAMap) {
  const HazardWorld world = HazardWorld::OfRocks(3, 60);
  const std::vector<Submap::Source> sources = {{world.MapAt(Pose()), {1, 0, 0.4}, {{{0, 0}, 1.5}}}};
  const Submap submap(sources);
  ASSERT_FALSE(submap.points().empty());
  EXPECT_FALSE(submap.distances().At({1, 0}).is_known);
  for (const Submap::Point& point : submap.points()) {
    EXPECT_GT((point.position_m - Eigen::Vector2d(1, 0)).norm(), 1.4);
    EXPECT_LE((point.position_m - Eigen::Vector2d(1, 0)).norm(), 9.1);
  }
}

TEST(SubmapTest, KnowsWallsFromCorners) {
  HazardWorld world;
  world.walls = {{{-5, 2}, {5, 2}}, {{3, -5}, {3, 5}}};
  const std::vector<Submap::Source> sources = {{world.MapAt(Pose()), {}, {}}};
  const Submap submap(sources);
  int walls = 0, corners = 0;
  for (const Submap::Point& point : submap.points()) {
    const Eigen::Vector2d& at = point.position_m;
    if (std::abs(at.x() - 3) < 0.2 && std::abs(at.y() - 2) < 0.2) {
      ++corners;
      EXPECT_TRUE(point.is_corner) << at.transpose();
    } else if (std::abs(at.x() - 3) > 1 && std::abs(at.x()) < 4) {
      ++walls;
      EXPECT_FALSE(point.is_corner) << at.transpose();
      EXPECT_GT(std::abs(point.normal.y()), 0.99) << at.transpose();
    }
  }
  EXPECT_GT(corners, 2);
  EXPECT_GT(walls, 30);
}

}  // namespace
}  // namespace moondb
