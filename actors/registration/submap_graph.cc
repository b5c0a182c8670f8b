#include "actors/registration/submap_graph.h"

#include <Eigen/Cholesky>

namespace moondb {
namespace {

constexpr int kIterations = 5;
constexpr double kFixedVariance = 1e-9;

}  // namespace

SubmapGraph::Linear SubmapGraph::Linearized(const Factor& factor) const {
  const PlanarOffset& from = poses_[factor.from];
  const PlanarOffset& to = poses_[factor.to];
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(-from.yaw_rad).toRotationMatrix();
  const Eigen::Vector2d moved_m = turn * (to.position_m() - from.position_m());
  Linear linear;
  linear.residual << moved_m - factor.from_from_to.position_m(),
      WrappedAngle(to.yaw_rad - from.yaw_rad - factor.from_from_to.yaw_rad);
  linear.by_from.setZero();
  linear.by_from.topLeftCorner<2, 2>() = -turn;
  linear.by_from.topRightCorner<2, 1>() << moved_m.y(), -moved_m.x();
  linear.by_from(2, 2) = -1;
  linear.by_to.setZero();
  linear.by_to.topLeftCorner<2, 2>() = turn;
  linear.by_to(2, 2) = 1;
  return linear;
}

void SubmapGraph::Solve() {
  const auto size = static_cast<Eigen::Index>(3 * poses_.size());
  Eigen::MatrixXd information;
  for (int i = 0; i < kIterations; ++i) {
    information = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    information.topLeftCorner<3, 3>().diagonal().setConstant(1 / kFixedVariance);
    for (const Factor& factor : factors_) {
      const Linear linear = Linearized(factor);
      const Eigen::Matrix3d weight = factor.covariance.inverse();
      const auto from = static_cast<Eigen::Index>(3 * factor.from);
      const auto to = static_cast<Eigen::Index>(3 * factor.to);
      const Eigen::Matrix3d cross = linear.by_from.transpose() * weight * linear.by_to;
      information.block<3, 3>(from, from) += linear.by_from.transpose() * weight * linear.by_from;
      information.block<3, 3>(to, to) += linear.by_to.transpose() * weight * linear.by_to;
      information.block<3, 3>(from, to) += cross;
      information.block<3, 3>(to, from) += cross.transpose();
      gradient.segment<3>(from) += linear.by_from.transpose() * weight * linear.residual;
      gradient.segment<3>(to) += linear.by_to.transpose() * weight * linear.residual;
    }
    const Eigen::VectorXd step = information.llt().solve(gradient);
    if (!step.allFinite()) break;
    for (std::size_t k = 1; k < poses_.size(); ++k) {
      poses_[k].x_m -= step(static_cast<Eigen::Index>(3 * k));
      poses_[k].y_m -= step(static_cast<Eigen::Index>(3 * k + 1));
      poses_[k].yaw_rad = WrappedAngle(poses_[k].yaw_rad - step(static_cast<Eigen::Index>(3 * k + 2)));
    }
    if (step.cwiseAbs().maxCoeff() < 1e-6) break;
  }
  covariance_ = information.llt().solve(Eigen::MatrixXd::Identity(size, size));
}

Eigen::Matrix3d SubmapGraph::RelativeCovarianceOf(std::size_t from, std::size_t to) const {
  const Linear linear = Linearized({from, to, {}, {}});
  const auto f = static_cast<Eigen::Index>(3 * from);
  const auto t = static_cast<Eigen::Index>(3 * to);
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << linear.by_from, linear.by_to;
  Eigen::Matrix<double, 6, 6> joint;
  joint << covariance_.block<3, 3>(f, f), covariance_.block<3, 3>(f, t), covariance_.block<3, 3>(t, f),
      covariance_.block<3, 3>(t, t);
  return jacobian * joint * jacobian.transpose();
}

double SubmapGraph::ChiSquareOf(const Factor& factor, bool with_poses) const {
  const Eigen::Vector3d residual = Linearized(factor).residual;
  Eigen::Matrix3d covariance = factor.covariance;
  if (with_poses) covariance += RelativeCovarianceOf(factor.from, factor.to);
  return residual.dot(covariance.inverse() * residual);
}

}  // namespace moondb
