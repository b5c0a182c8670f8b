#include "actors/registration/rover_track.h"

#include <gtest/gtest.h>

#include <random>

namespace moondb {
namespace {

// A track that turns, with a covariance that grows from step to step.
std::vector<RoverTrack::Step> Steps() {
  std::vector<RoverTrack::Step> steps;
  PlanarOffset pose;
  for (std::uint64_t i = 0; i < 12; ++i) {
    const double k = static_cast<double>(i);
    Eigen::Matrix3d covariance = Eigen::Vector3d(1e-4 * (1 + k), 2e-4, 1e-5 * (2 + k)).asDiagonal();
    covariance(0, 1) = covariance(1, 0) = 3e-5;
    steps.push_back({{1, i}, pose, covariance});
    pose = pose * PlanarOffset{1, 0, 0.3};
  }
  return steps;
}

TEST(RoverTrackTest, HasTheCovarianceOfErrorsThatAddUp) {
  const std::vector<RoverTrack::Step> steps = Steps();
  const RoverTrack track(steps);
  const Eigen::Vector2d target_m(2, 7);
  // Propagates step by step: an error of yaw at a node moves the target about that node.
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  for (std::size_t i = 4; i <= 9; ++i) {
    Eigen::Matrix3d step = steps[i].covariance;
    step(0, 2) = step(2, 0) = step(1, 2) = step(2, 1) = 0;
    expected += ShiftedCovariance(step, target_m - steps[i].odom_from_node.position_m());
  }
  const Eigen::Vector2d moved_m = steps[9].odom_from_node.position_m() - steps[3].odom_from_node.position_m();
  expected.topLeftCorner<2, 2>() += RoverTrack::kScaleSigma * RoverTrack::kScaleSigma * moved_m * moved_m.transpose();
  EXPECT_LT((track.CovarianceOf(3, 9, target_m) - expected).norm(), 1e-12);
  EXPECT_LT((track.CovarianceOf(9, 3, target_m) - expected).norm(), 1e-12) << "the same errors backwards";
  EXPECT_LT(track.CovarianceOf(5, 5, target_m).norm(), 1e-15);
}

TEST(RoverTrackTest, MeasuresThePathAlongTheNodes) {
  const RoverTrack track(Steps());
  EXPECT_EQ(track.path_m(0), 0);
  EXPECT_NEAR(track.path_m(11), 11, 1e-9);
}

}  // namespace
}  // namespace moondb
