#include "actors/pgo/factors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace moondb {
namespace {

Pose RandomPose(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond orientation(normal(rng), normal(rng), normal(rng), normal(rng));
  return Pose{{3 * normal(rng), 3 * normal(rng), normal(rng)}, orientation.normalized()};
}

Matrix6d RandomCovariance(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root.data()[i] = normal(rng);
  return root * root.transpose() + 0.1 * Matrix6d::Identity();
}

// Compares each Jacobian with central differences on PoseManifold.
void ExpectJacobiansMatch(const ceres::CostFunction& factor, std::vector<std::vector<double>> blocks) {
  const int rows = factor.num_residuals();
  std::vector<double*> parameters;
  std::vector<std::vector<double>> jacobians;
  std::vector<double*> jacobian_pointers;
  for (std::vector<double>& block : blocks) {
    parameters.push_back(block.data());
    jacobians.emplace_back(static_cast<std::size_t>(rows) * block.size(), 1e9);
  }
  for (std::vector<double>& jacobian : jacobians) jacobian_pointers.push_back(jacobian.data());
  std::vector<double> residuals(static_cast<std::size_t>(rows));
  ASSERT_TRUE(factor.Evaluate(parameters.data(), residuals.data(), jacobian_pointers.data()));

  constexpr double kStep = 1e-6;
  const PoseManifold manifold;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const std::vector<double> original = blocks[b];
    const bool is_pose = original.size() == kPoseSize;
    for (std::size_t i = 0; i < (is_pose ? kPoseTangentSize : original.size()); ++i) {
      std::vector<std::vector<double>> sides;
      for (const double sign : {1.0, -1.0}) {
        std::vector<double> delta(original.size(), 0);
        delta[i] = sign * kStep;
        if (is_pose) {
          manifold.Plus(original.data(), delta.data(), blocks[b].data());
        } else {
          blocks[b][i] = original[i] + delta[i];
        }
        sides.emplace_back(static_cast<std::size_t>(rows));
        factor.Evaluate(parameters.data(), sides.back().data(), nullptr);
      }
      blocks[b] = original;
      parameters[b] = blocks[b].data();
      for (int row = 0; row < rows; ++row) {
        const auto r = static_cast<std::size_t>(row);
        const double numeric = (sides[0][r] - sides[1][r]) / (2 * kStep);
        EXPECT_NEAR(jacobians[b][r * original.size() + i], numeric, 1e-6 * (1 + std::abs(numeric)))
            << "block " << b << ", row " << row << ", column " << i;
      }
    }
    if (!is_pose) continue;
    for (std::size_t row = 0; row < static_cast<std::size_t>(rows); ++row) {
      EXPECT_EQ(jacobians[b][row * kPoseSize + 6], 0);
    }
  }
}

std::vector<double> Block(const Pose& pose) {
  const PoseBlock block = ToBlock(pose);
  return {block.begin(), block.end()};
}

class FactorsTest : public testing::TestWithParam<std::uint64_t> {
 protected:
  void SetUp() override { RecordProperty("seed", static_cast<int>(GetParam())); }
  std::mt19937_64 rng_{GetParam()};
};

INSTANTIATE_TEST_SUITE_P(Seeds, FactorsTest, testing::Range<std::uint64_t>(1, 9));

TEST_P(FactorsTest, OdometryHasTheJacobianOfItsResidual) {
  const auto factor = MakeOdometryFactor(RandomPose(rng_), RandomCovariance(rng_));
  ExpectJacobiansMatch(*factor, {Block(RandomPose(rng_)), Block(RandomPose(rng_)), {0.03}});
}

TEST_P(FactorsTest, RangeHasTheJacobianOfItsResidual) {
  const auto factor = MakeRangeFactor(4.2, 0.1, {0.3, -0.2, 0.5}, {0.1, 0.4, 1.5});
  ExpectJacobiansMatch(*factor, {Block(RandomPose(rng_)), Block(RandomPose(rng_)), {0.07}});
}

TEST_P(FactorsTest, LoopClosureHasTheJacobianOfItsResidual) {
  const auto factor = MakeLoopClosureFactor(RandomPose(rng_), RandomCovariance(rng_));
  ExpectJacobiansMatch(*factor, {Block(RandomPose(rng_)), Block(RandomPose(rng_))});
}

TEST_P(FactorsTest, PriorsHaveTheJacobiansOfTheirResiduals) {
  ExpectJacobiansMatch(*MakeSightingFactor({1, -2, 0.5}, 0.1), {Block(RandomPose(rng_)), Block(RandomPose(rng_))});
  for (const PriorExtent extent : {PriorExtent::kPosition, PriorExtent::kPositionYaw, PriorExtent::kPose}) {
    NodePrior prior;
    prior.extent = extent;
    prior.map_from_node = RandomPose(rng_);
    prior.covariance = RandomCovariance(rng_);
    prior.point_m = {0.4, -0.1, 0.9};
    const auto factor = MakePriorFactor(prior);
    EXPECT_EQ(factor->num_residuals(), static_cast<int>(extent));
    ExpectJacobiansMatch(*factor, {Block(RandomPose(rng_))});
  }
  ExpectJacobiansMatch(*MakeGravityFactor(Eigen::Vector3d(0.1, -0.2, 0.97).normalized(), 0.02),
                       {Block(RandomPose(rng_))});
  ExpectJacobiansMatch(*MakeZeroPriorFactor(0.02), {{0.013}});
}

TEST_P(FactorsTest, ManifoldMinusInvertsPlus) {
  const PoseManifold manifold;
  const PoseBlock x = ToBlock(RandomPose(rng_));
  const std::array<double, 6> delta = {0.3, -2, 1, 0.4, -0.9, 1.1};
  PoseBlock y{};
  std::array<double, 6> back{};
  ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), y.data()));
  ASSERT_TRUE(manifold.Minus(y.data(), x.data(), back.data()));
  EXPECT_THAT(back, testing::Pointwise(testing::DoubleNear(1e-12), delta));
}

TEST_P(FactorsTest, OdometryIsWeightedByTheWholeInformationMatrix) {
  const Matrix6d covariance = RandomCovariance(rng_);
  const Pose step = RandomPose(rng_);
  const Pose from = RandomPose(rng_);
  const Pose to = RandomPose(rng_);
  const Pose moved = from.Inverse() * to;
  const Eigen::Quaterniond turn = step.orientation.conjugate() * moved.orientation;
  Eigen::Matrix<double, 6, 1> raw;
  raw << moved.position_m - 1.02 * step.position_m, (turn.w() < 0 ? -2 : 2) * turn.vec();

  Eigen::Matrix<double, 6, 1> residual;
  const std::vector<double> from_block = Block(from);
  const std::vector<double> to_block = Block(to);
  const double scale = 0.02;
  const std::array<const double*, 3> parameters = {from_block.data(), to_block.data(), &scale};
  ASSERT_TRUE(MakeOdometryFactor(step, covariance)->Evaluate(parameters.data(), residual.data(), nullptr));
  EXPECT_NEAR(residual.squaredNorm(), raw.dot(covariance.inverse() * raw), 1e-6 * residual.squaredNorm());
}

TEST(FactorsAtTheEdgeTest, RangeOfZeroDistanceHasAFiniteJacobian) {
  const auto factor = MakeRangeFactor(0.5, 0.1, {0, 0, 0}, {0, 0, 0});
  const std::vector<double> pose = Block(Pose{});
  const double bias = 0;
  const std::array<const double*, 3> parameters = {pose.data(), pose.data(), &bias};
  double residual = 0;
  std::array<double, kPoseSize> a{};
  std::array<double, kPoseSize> b{};
  std::array<double*, 3> jacobians = {a.data(), b.data(), nullptr};
  ASSERT_TRUE(factor->Evaluate(parameters.data(), &residual, jacobians.data()));
  EXPECT_NEAR(residual, -5, 1e-12);
  EXPECT_THAT(a, testing::Each(0.0));
  EXPECT_THAT(b, testing::Each(0.0));
}

TEST(FactorsAtTheEdgeTest, APriorMeasuresItsPointAndWrapsItsYaw) {
  NodePrior prior;
  prior.extent = PriorExtent::kPositionYaw;
  prior.map_from_node = Pose::FromPlanar(5, 2, 3.1);
  prior.point_m = {0, 1, 0};
  prior.covariance.diagonal() << 0.25, 0.25, 0.25, 0.01, 1, 1;
  const std::vector<double> block = Block(Pose::FromPlanar(5, 3, -3.1));
  const double* parameters = block.data();
  std::array<double, 4> residuals{};
  ASSERT_TRUE(MakePriorFactor(prior)->Evaluate(&parameters, residuals.data(), nullptr));
  EXPECT_NEAR(residuals[0], std::sin(3.1) / 0.5, 1e-9) << "the point lies beside the body";
  EXPECT_NEAR(residuals[1], (3 + std::cos(3.1) - 2) / 0.5, 1e-9);
  EXPECT_NEAR(residuals[3], (2 * M_PI - 6.2) / 0.1, 1e-9) << "the shorter way round";
}

TEST(FactorsAtTheEdgeTest, AQuaternionAndItsNegativeAreOneOrientation) {
  const Pose pose{{1, 2, 3}, Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5)};
  const Pose same{{1, 2, 3}, Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)};
  std::array<double, 6> residuals{};
  const std::vector<double> block = Block(pose);
  const double* parameters = block.data();
  NodePrior prior;
  prior.map_from_node = same;
  ASSERT_TRUE(MakePriorFactor(prior)->Evaluate(&parameters, residuals.data(), nullptr));
  EXPECT_THAT(residuals, testing::Each(testing::DoubleNear(0, 1e-12)));
}

}  // namespace
}  // namespace moondb
