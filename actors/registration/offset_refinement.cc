#include "actors/registration/offset_refinement.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace moondb {
namespace {

constexpr int kIterations = 20;
constexpr double kStepMax_m = 0.1;
constexpr double kPointSigma_m = 0.05;
constexpr double kVarianceFactor = 40;

}  // namespace

void OffsetRefinement::Run(PlanarOffset& offset, double loss_m, const OffsetPrior* prior) const {
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Accumulate(offset, loss_m, hessian, gradient);
    if (prior != nullptr) {
      const Eigen::Matrix3d weight = prior->information * (kPointSigma_m * kPointSigma_m * kVarianceFactor);
      const PlanarOffset& expected = prior->expected;
      hessian += weight;
      gradient += weight * Eigen::Vector3d(offset.x_m - expected.x_m, offset.y_m - expected.y_m,
                                           WrappedAngle(offset.yaw_rad - expected.yaw_rad));
    }
    const Eigen::Vector3d step = hessian.ldlt().solve(gradient);
    if (!step.allFinite()) return;
    const double length = step.head<2>().norm();
    const double factor = length > kStepMax_m ? kStepMax_m / length : 1;
    offset.x_m -= factor * step.x();
    offset.y_m -= factor * step.y();
    offset.yaw_rad -= factor * step.z();
    if (length < 1e-4 && std::abs(step.z()) < 1e-5) return;
  }
}

Eigen::Matrix3d OffsetRefinement::CovarianceAt(const PlanarOffset& offset, double loss_m) const {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Accumulate(offset, loss_m, hessian, gradient);
  const Eigen::Matrix3d covariance = hessian.inverse() * (kPointSigma_m * kPointSigma_m * kVarianceFactor);
  return (covariance + covariance.transpose()) / 2;
}

// Adds weight * J^T J and weight * J^T r over the points of both maps, and a small diagonal.
void OffsetRefinement::Accumulate(const PlanarOffset& offset, double loss_m, Eigen::Matrix3d& hessian,
                                  Eigen::Vector3d& gradient) const {
  const Eigen::Isometry2d first_from_second = offset.ToTransform();
  const Eigen::Isometry2d second_from_first = first_from_second.inverse();
  const auto add = [&](const DistanceField::Distance& distance, const Eigen::Vector3d& jacobian) {
    if (!distance.is_known && distance.distance_m > loss_m) return;
    const double ratio = distance.distance_m / loss_m;
    const double weight = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
    hessian += weight * jacobian * jacobian.transpose();
    gradient += weight * distance.distance_m * jacobian;
  };
  for (const Eigen::Vector2d& point_m : second_.points_m) {
    const Eigen::Vector2d turned = first_from_second.linear() * point_m;
    const DistanceField::Distance distance = first_.distances.At(turned + first_from_second.translation());
    const Eigen::Vector2d& g = distance.gradient;
    add(distance, {g.x(), g.y(), g.y() * turned.x() - g.x() * turned.y()});
  }
  for (const Eigen::Vector2d& point_m : first_.points_m) {
    const Eigen::Vector2d moved = second_from_first * point_m;
    const DistanceField::Distance distance = second_.distances.At(moved);
    const Eigen::Vector2d& g = distance.gradient;
    // The derivative of `moved` is -R^T for x and y, and (moved.y, -moved.x) for yaw.
    const Eigen::Vector2d along = -(first_from_second.linear() * g);
    add(distance, {along.x(), along.y(), g.x() * moved.y() - g.y() * moved.x()});
  }
  hessian.diagonal() += Eigen::Vector3d::Constant(1e-6);
}

}  // namespace moondb
