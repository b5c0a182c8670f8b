#include "actors/merge/quantize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace moondb {
namespace {

constexpr double kUnit = 1.0 / (1 << kFractionBits);

PlacedRectangle QuantizeAt(const Pose& pose, int width = 4, int height = 2, std::uint32_t cell_um = 50'000,
                           std::uint32_t grid_um = 50'000) {
  return Quantize(ToPlanar(pose), 0, 0, width, height, cell_um, grid_um);
}

TEST(QuantizeTest, AnAlignedRectangleCoversItsOwnCells) {
  const PlacedRectangle placed = QuantizeAt(Pose::FromPlanar(0.1, 0.05, 0));
  EXPECT_EQ(placed.box, (CellBox{0, 0, 3, 1}));
  EXPECT_EQ(placed.step_cos, 1 << kFractionBits);
  EXPECT_EQ(placed.step_sin, 0);
  EXPECT_EQ(placed.width_q, 4u << kFractionBits);
}

TEST(QuantizeTest, AQuarterTurnSwapsTheSides) {
  const PlacedRectangle placed = QuantizeAt(Pose::FromPlanar(0.05, 0.1, M_PI_2));
  EXPECT_EQ(placed.box, (CellBox{0, 0, 1, 3}));
  EXPECT_EQ(placed.step_sin, 1 << kFractionBits);
}

TEST(QuantizeTest, StepsDoNotDependOnThePosition) {
  const PlacedRectangle near = QuantizeAt(Pose::FromPlanar(0.025, 0.025, 0.5));
  const PlacedRectangle far = QuantizeAt(Pose::FromPlanar(1e6 + 0.025, -1e6 + 0.025, 0.5));
  EXPECT_EQ(far.anchor_x - near.anchor_x, 20'000'000);
  EXPECT_EQ(far.anchor_y - near.anchor_y, -20'000'000);
  EXPECT_EQ(far.step_cos, near.step_cos);
  EXPECT_EQ(far.step_sin, near.step_sin);
  EXPECT_NEAR(far.u0, near.u0, 0.001 / kUnit);
}

TEST(QuantizeTest, NegativeCoordinatesAreAnchoredBelow) {
  const PlacedRectangle placed = QuantizeAt(Pose::FromPlanar(-0.01, -0.01, 0));
  EXPECT_EQ(placed.anchor_x, -1);
  EXPECT_EQ(placed.anchor_y, -1);
}

TEST(QuantizeTest, ATiltedPoseIsProjectedOntoThePlane) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));
  const Eigen::Quaterniond pitch(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));
  Pose map_from_node;
  map_from_node.position_m = {1, 2, 3};
  map_from_node.orientation = turn * pitch;
  Pose node_from_map;
  node_from_map.position_m = {0.2, 0, 0};
  const PlanarPose planar = ToPlanar(map_from_node, node_from_map);
  EXPECT_NEAR(std::atan2(planar.sin_yaw, planar.cos_yaw), 0.7, 1e-12);
  EXPECT_NEAR(planar.x_m, 1 + 0.2 * std::cos(0.4) * std::cos(0.7), 1e-12);
  EXPECT_NEAR(planar.y_m, 2 + 0.2 * std::cos(0.4) * std::sin(0.7), 1e-12);
}

TEST(QuantizeTest, AHeadingStraightUpBecomesZero) {
  Pose pose;
  pose.orientation = Eigen::AngleAxisd(-M_PI_2, Eigen::Vector3d::UnitY());
  const PlanarPose planar = ToPlanar(pose);
  EXPECT_NEAR(std::hypot(planar.cos_yaw, planar.sin_yaw), 1, 1e-12);
}

// Compares QuantizeAt's integers with trigonometry. For a cell that is i columns and j rows away from the anchor, the
// error may be up to kUnit * (2 + i + j).
TEST(QuantizeTest, IntegersFollowTheGeometry) {
  constexpr std::uint64_t kSeed = 11;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int round = 0; round < 1000; ++round) {
    const double x_m = 5 * uniform(rng);
    const double y_m = 5 * uniform(rng);
    const double yaw = 4 * uniform(rng);
    const int width = 1 + static_cast<int>(rng() % 512);
    const int height = 1 + static_cast<int>(rng() % 512);
    const auto cell_um = static_cast<std::uint32_t>(50'000 * std::exp2(4 * uniform(rng)));
    const PlacedRectangle placed = QuantizeAt(Pose::FromPlanar(x_m, y_m, yaw), width, height, cell_um, 50'000);
    for (const double along : {-0.5, 0.0, 0.5}) {
      // Cell (x, y) lies on the rectangle's centre line.
      const double reach_m = along * width * cell_um / 1e6;
      const auto x = static_cast<std::int64_t>(std::floor((x_m + reach_m * std::cos(yaw)) / 0.05));
      const auto y = static_cast<std::int64_t>(std::floor((y_m + reach_m * std::sin(yaw)) / 0.05));
      const std::int64_t i = x - placed.anchor_x;
      const std::int64_t j = y - placed.anchor_y;
      const std::int64_t u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
      const double dx = (static_cast<double>(x) + 0.5) * 0.05 - x_m;
      const double dy = (static_cast<double>(y) + 0.5) * 0.05 - y_m;
      const double expected = (std::cos(yaw) * dx + std::sin(yaw) * dy) * 1e6 / cell_um + width / 2.0;
      ASSERT_NEAR(static_cast<double>(u) * kUnit, expected, kUnit * (2 + std::abs(double(i)) + std::abs(double(j))));
    }
  }
}

}  // namespace
}  // namespace moondb
