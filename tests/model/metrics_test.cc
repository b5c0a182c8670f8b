#include "model/metrics.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

namespace moondb {
namespace {

// Makes a map from a picture: '#' hazard, '.' free, ' ' unknown. The first string is the top row.
MergedMap MapOf(const std::vector<std::string>& picture, std::int64_t origin_x = 0, std::int64_t origin_y = 0) {
  MergedMap map{Grid(static_cast<std::int32_t>(picture[0].size()), static_cast<std::int32_t>(picture.size())), 50'000,
                origin_x, origin_y};
  for (std::int32_t row = 0; row < map.grid.height; ++row) {
    for (std::int32_t column = 0; column < map.grid.width; ++column) {
      const char c = picture[map.grid.height - 1 - row][column];
      map.grid.At(column, row) = c == '#' ? Cell::kHazard : c == '.' ? Cell::kFree : Cell::kUnknown;
    }
  }
  return map;
}

TEST(MetricsTest, TakesTheRootOfTheMeanSquaredDistanceOverTheAgentsAskedFor) {
  const std::map<NodeKey, Pose> truth = {{{1, 0}, Pose::FromPlanar(0, 0, 0)},
                                         {{1, 1}, Pose::FromPlanar(1, 0, 0)},
                                         {{2, 0}, Pose::FromPlanar(5, 5, 0)},
                                         {{2, 1}, Pose::FromPlanar(6, 5, 0)},
                                         {{4, 0}, Pose::FromPlanar(9, 9, 0)}};
  std::map<NodeKey, Pose> estimate = truth;
  estimate[{1, 1}].position_m += Eigen::Vector3d(0, 0, 2);
  estimate[{2, 0}].position_m += Eigen::Vector3d(3, 4, 0);
  estimate.erase({2, 1});
  const TrajectoryError error = CompareTrajectories(estimate, truth, {1, 2});
  EXPECT_DOUBLE_EQ(error.rmse_m, std::sqrt((0.0 + 4 + 25) / 3));
  EXPECT_DOUBLE_EQ(error.max_m, 5);
  EXPECT_EQ(error.node_count, 3u);
  EXPECT_EQ(error.missing_count, 1u);
  EXPECT_EQ(CompareTrajectories({}, truth, {1}).rmse_m, 0);
}

TEST(MetricsTest, ForgivesTwoCellsInEachDirectionAndNoMore) {
  const MergedMap truth = MapOf({".......", ".......", ".......", "...#...", ".......", ".......", "......."});
  const auto iou_of = [&truth](int x, int y) {
    MergedMap map = MapOf({".......", ".......", ".......", ".......", ".......", ".......", "......."});
    map.grid.At(3 + x, 3 + y) = Cell::kHazard;
    return CompareMaps(map, truth)->hazard_iou;
  };
  EXPECT_EQ(iou_of(0, 0), 1);
  EXPECT_EQ(iou_of(2, 2), 1);
  EXPECT_EQ(iou_of(-2, 2), 1);
  EXPECT_EQ(iou_of(3, 0), 0);
  EXPECT_EQ(iou_of(0, -3), 0);
}

TEST(MetricsTest, AgreesWithAHandComputedCase) {
  // Map hazards are at 0, 3 and 9; the first two are within 2 cells of a true hazard. True hazards are at 1, 2, 15 and
  // 16; the first two are within 2 cells of a map hazard.
  // Precision 2/3, recall 1/2, F1 4/7, IoU (4/7) / (2 - 4/7) = 0.4.
  const MergedMap map = MapOf({"#..#.....#......."});
  const MergedMap truth = MapOf({".##............##"});
  const Result<MapAgreement> agreement = CompareMaps(map, truth);
  ASSERT_TRUE(agreement);
  EXPECT_DOUBLE_EQ(agreement->precision, 2.0 / 3);
  EXPECT_DOUBLE_EQ(agreement->recall, 0.5);
  EXPECT_DOUBLE_EQ(agreement->f1, 4.0 / 7);
  EXPECT_DOUBLE_EQ(agreement->hazard_iou, 0.4);
  EXPECT_EQ(agreement->map_hazard_count, 3u);
  EXPECT_EQ(agreement->true_hazard_count, 4u);
}

TEST(MetricsTest, CountsKappaOverCellsKnownInBoth) {
  // Cells known in map and truth: 10. Hazard in both: 3; free in both: 4; hazard only in the map: 1, only in the
  // truth: 2. Observed agreement 0.7, by chance 0.4 * 0.5 + 0.6 * 0.5 = 0.5, so kappa is 0.4.
  const MergedMap map = MapOf({"####......  ##"});
  const MergedMap truth = MapOf({"###.##....##  "});
  const Result<MapAgreement> agreement = CompareMaps(map, truth, 0);
  ASSERT_TRUE(agreement);
  EXPECT_EQ(agreement->known_in_both_count, 10u);
  EXPECT_NEAR(agreement->kappa, 0.4, 1e-12);
}

TEST(MetricsTest, PlacesMapsByTheirOrigins) {
  const MergedMap map = MapOf({"....", ".#.."}, -10, 20);
  const MergedMap truth = MapOf({".......", "...#...", ".......", "......."}, -12, 18);
  const Result<MapAgreement> agreement = CompareMaps(map, truth, 0);
  ASSERT_TRUE(agreement);
  EXPECT_EQ(agreement->hazard_iou, 1);
  EXPECT_EQ(agreement->kappa, 1);
  EXPECT_EQ(agreement->known_in_both_count, 8u);
  const Result<MapAgreement> far = CompareMaps(MapOf({"#"}, std::int64_t{1} << 40), truth, 2);
  EXPECT_EQ(far->hazard_iou, 0);
  EXPECT_EQ(far->known_in_both_count, 0u);
  EXPECT_EQ(far->kappa, 0);
}

TEST(MetricsTest, StaysDefinedWithoutHazards) {
  const MergedMap free_map = MapOf({"...."});
  const MergedMap hazard_map = MapOf({".#.."});
  EXPECT_EQ(CompareMaps(free_map, free_map)->hazard_iou, 1);
  EXPECT_EQ(CompareMaps(free_map, free_map)->kappa, 1);
  EXPECT_EQ(CompareMaps(free_map, hazard_map)->hazard_iou, 0);
  EXPECT_EQ(CompareMaps(hazard_map, free_map)->hazard_iou, 0);
  EXPECT_EQ(CompareMaps(free_map, hazard_map)->kappa, 0);
}

TEST(MetricsTest, RefusesMapsOfTwoResolutions) {
  MergedMap other = MapOf({"."});
  other.resolution_um = 100'000;
  EXPECT_EQ(CompareMaps(MapOf({"."}), other).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(CompareMaps(other, other, -1).error().field, "tolerance_cells");
}

TEST(MetricsTest, AlignsTrajectoriesWithoutAMapFrame) {
  for (const bool is_planar : {false, true}) {
    Pose truth_from_estimate = Pose::FromPlanar(3, -2, 0.7);
    if (!is_planar)
      truth_from_estimate.orientation *= Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()));
    std::map<NodeKey, Pose> estimate;
    std::map<NodeKey, Pose> truth;
    for (std::uint64_t i = 0; i < 10; ++i) {
      const auto t = static_cast<double>(i);
      const NodeKey key{1, i};
      estimate[key] = Pose{{t, t * t, is_planar ? 0 : std::sin(t)}, Eigen::Quaterniond::Identity()};
      truth[key] = truth_from_estimate * estimate[key];
    }
    const Pose found = FindAlignment(estimate, truth, is_planar);
    EXPECT_LT((found.position_m - truth_from_estimate.position_m).norm(), 1e-9);
    EXPECT_LT(found.orientation.angularDistance(truth_from_estimate.orientation), 1e-7);
  }
  EXPECT_EQ(FindAlignment({}, {}, true).position_m, Eigen::Vector3d(0, 0, 0));
}

TEST(MetricsTest, MatchesHazardsCellByCell) {
  const MergedMap truth = MapOf({"#......#", "        "});
  const MergedMap map = MapOf({".#..#...", ".       "});
  const auto matches = MatchHazardCells(map, truth, 1);
  ASSERT_TRUE(matches) << ToString(matches.error());
  std::string drawn;
  for (const HazardMatch match : *matches) drawn += " .+?!"[static_cast<int>(match)];
  // The upper row comes last. The true hazard in column 0 and the map's hazard in column 1 match. The true hazard in
  // column 7 is missed, and the map's hazard in column 4 is a phantom.
  EXPECT_EQ(drawn, ".       ++..!..?");
  EXPECT_EQ(MatchHazardCells(map, MapOf({"#"}), 1).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(MatchHazardCells(map, truth, 101).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
