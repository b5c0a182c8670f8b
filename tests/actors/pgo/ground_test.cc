#include "actors/pgo/ground.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace moondb {
namespace {

constexpr double kTiltNoise_rad = 0.002;
constexpr double kGravitySigma_rad = 0.02;

Eigen::Quaterniond Pitch(double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
}

class GroundTest : public testing::Test {
 protected:
  // Adds nodes and noisy odometry steps along x, over terrain with the slope `slope_at`. A node's raw pose is the
  // composition of all steps before it.
  void Drive(AgentId agent, std::uint64_t seed, std::uint64_t count, const std::function<double(double)>& slope_at) {
    std::mt19937_64 rng(seed);
    // A quaternion component of a small rotation is half the rotation's angle.
    std::normal_distribution<double> noise(0, kTiltNoise_rad / 2);
    Pose raw{Eigen::Vector3d::Zero(), Pitch(-slope_at(0))};
    for (std::uint64_t i = 0; i < count; ++i) {
      if (i > 0) {
        const double x = 0.3 * static_cast<double>(i);
        OdometryEdge edge{{agent, i - 1}, {agent, i}, 0, Pose::FromPlanar(0.3, 0, 0), 1e-4 * Matrix6d::Identity()};
        edge.covariance.bottomRightCorner<3, 3>() = kTiltNoise_rad * kTiltNoise_rad * Eigen::Matrix3d::Identity();
        edge.from_from_to.orientation =
            Pitch(slope_at(x - 0.3) - slope_at(x)) * Eigen::Quaterniond(1, noise(rng), noise(rng), 0).normalized();
        raw = raw * edge.from_from_to;
        graph_.odometry.push_back(edge);
      }
      graph_.nodes.push_back(GraphNode{{agent, i}, 0, raw});
    }
  }

  std::vector<bool> Level() {
    const CheckedGraph checked = CheckGraph(graph_, {});
    return FindLevelGround(checked, FindRovers(checked), kGravitySigma_rad);
  }

  static double Flat(double) { return 0; }
  static double Hill(double x) { return std::atan(5 * 2 * M_PI / 200 * std::cos(2 * M_PI / 200 * x)); }

  PoseGraph graph_;
};

TEST_F(GroundTest, CountsAsLevelIfTheTiltIsAccumulatedNoise) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    graph_ = {};
    Drive(1, seed, 10 + 2 * seed, Flat);
    ASSERT_THAT(Level(), testing::ElementsAre(true));
  }
}

TEST_F(GroundTest, FindsAHillGentlerThanTheNoiseOfAStep) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    graph_ = {};
    Drive(1, seed, 400, [](double x) { return Hill(x + 50) - Hill(50); });  // The drive starts on level terrain.
    ASSERT_THAT(Level(), testing::ElementsAre(false));
  }
}

TEST_F(GroundTest, FindsAConstantSlope) {
  Drive(1, 1, 50, [](double) { return 0.1; });
  EXPECT_THAT(Level(), testing::ElementsAre(false));
}

TEST_F(GroundTest, JudgesEachRoverSeparately) {
  Drive(1, 1, 400, Flat);
  Drive(2, 2, 400, Hill);
  EXPECT_THAT(Level(), testing::ElementsAre(true, false));
}

TEST_F(GroundTest, TrustsRawPosesWithoutOdometry) {
  Drive(1, 1, 20, Flat);
  graph_.odometry.clear();
  EXPECT_THAT(Level(), testing::ElementsAre(false));
}

}  // namespace
}  // namespace moondb
