#include "actors/pgo/factors.h"

#include <ceres/sized_cost_function.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace moondb {

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
template <int kRows>
using PoseJacobian = Eigen::Matrix<double, kRows, kPoseSize, Eigen::RowMajor>;

constexpr double kZeroDistance_m = 1e-9;

Eigen::Map<const Eigen::Vector3d> PositionOf(const double* block) { return Eigen::Map<const Eigen::Vector3d>(block); }

Eigen::Quaterniond OrientationOf(const double* block) {
  return Eigen::Map<const Eigen::Quaterniond>(block + 3).normalized();
}

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d result;
  result << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return result;
}

// q and -q are the same rotation. Returns the one with w >= 0.
Eigen::Quaterniond WithPositiveW(const Eigen::Quaterniond& q) {
  return q.w() < 0 ? Eigen::Quaterniond(-q.w(), -q.x(), -q.y(), -q.z()) : q;
}

class OdometryFactor final : public ceres::SizedCostFunction<6, kPoseSize, kPoseSize, 1> {
 public:
  OdometryFactor(const Pose& from_from_to, const Matrix6d& covariance)
      : step_(from_from_to), step_inverse_(from_from_to.orientation.conjugate()) {
    // covariance = L L^T, so W = L^-1 has W^T W = covariance^-1.
    whitener_ = Eigen::LLT<Matrix6d>(covariance).matrixL().solve(Matrix6d::Identity());
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Quaterniond from = OrientationOf(parameters[0]);
    const Eigen::Quaterniond to = OrientationOf(parameters[1]);
    const double scale = 1 + parameters[2][0];
    const Eigen::Matrix3d body_from_map = from.conjugate().toRotationMatrix();
    const Eigen::Vector3d moved = body_from_map * (PositionOf(parameters[1]) - PositionOf(parameters[0]));
    const Eigen::Quaterniond error = WithPositiveW(step_inverse_ * (from.conjugate() * to));

    Vector6d raw;
    raw << moved - scale * step_.position_m, 2 * error.vec();
    Eigen::Map<Vector6d> whitened(residuals);
    whitened = whitener_ * raw;
    if (jacobians == nullptr) return true;

    const Eigen::Matrix3d error_cross = Cross(error.vec());
    const Eigen::Matrix3d error_scalar = error.w() * Eigen::Matrix3d::Identity();
    if (jacobians[0] != nullptr) {
      Matrix6d j = Matrix6d::Zero();
      j.topLeftCorner<3, 3>() = -body_from_map;
      j.topRightCorner<3, 3>() = Cross(moved);
      j.bottomRightCorner<3, 3>() = -(error_scalar - error_cross) * step_inverse_.toRotationMatrix();
      WriteWhitened(j, jacobians[0]);
    }
    if (jacobians[1] != nullptr) {
      Matrix6d j = Matrix6d::Zero();
      j.topLeftCorner<3, 3>() = body_from_map;
      j.bottomRightCorner<3, 3>() = error_scalar + error_cross;
      WriteWhitened(j, jacobians[1]);
    }
    if (jacobians[2] != nullptr) {
      Eigen::Map<Vector6d> out(jacobians[2]);
      out = -whitener_.leftCols<3>() * step_.position_m;
    }
    return true;
  }

 private:
  void WriteWhitened(const Matrix6d& j, double* jacobian) const {
    Eigen::Map<PoseJacobian<6>> out(jacobian);
    out.leftCols<6>() = whitener_ * j;
    out.col(6).setZero();
  }

  Pose step_;
  Eigen::Quaterniond step_inverse_;
  Matrix6d whitener_;
};

class RangeFactor final : public ceres::SizedCostFunction<1, kPoseSize, kPoseSize, 1> {
 public:
  RangeFactor(double range_m, double sigma_m, const Eigen::Vector3d& antenna_a_m, const Eigen::Vector3d& antenna_b_m)
      : range_m_(range_m), weight_(1 / sigma_m), antennas_m_{antenna_a_m, antenna_b_m} {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const std::array<Eigen::Matrix3d, 2> rotations = {OrientationOf(parameters[0]).toRotationMatrix(),
                                                      OrientationOf(parameters[1]).toRotationMatrix()};
    const Eigen::Vector3d between = PositionOf(parameters[0]) + rotations[0] * antennas_m_[0] -
                                    PositionOf(parameters[1]) - rotations[1] * antennas_m_[1];
    const double distance_m = between.norm();
    residuals[0] = weight_ * (distance_m + parameters[2][0] - range_m_);
    if (jacobians == nullptr) return true;

    Eigen::RowVector3d direction = Eigen::RowVector3d::Zero();
    if (distance_m > kZeroDistance_m) direction = weight_ / distance_m * between.transpose();
    for (const std::size_t end : {0u, 1u}) {
      if (jacobians[end] == nullptr) continue;
      const Eigen::RowVector3d along = end == 0 ? direction : Eigen::RowVector3d(-direction);
      Eigen::Map<PoseJacobian<1>> out(jacobians[end]);
      out.leftCols<3>() = along;
      out.middleCols<3>(3) = -along * rotations[end] * Cross(antennas_m_[end]);
      out(6) = 0;
    }
    if (jacobians[2] != nullptr) jacobians[2][0] = weight_;
    return true;
  }

 private:
  double range_m_;
  double weight_;
  std::array<Eigen::Vector3d, 2> antennas_m_;
};

class SightingFactor final : public ceres::SizedCostFunction<3, kPoseSize, kPoseSize> {
 public:
  SightingFactor(const Eigen::Vector3d& from_point_m, double sigma_m) : seen_(from_point_m), weight_(1 / sigma_m) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Matrix3d body_from_map = OrientationOf(parameters[0]).conjugate().toRotationMatrix();
    const Eigen::Vector3d point = body_from_map * (PositionOf(parameters[1]) - PositionOf(parameters[0]));
    Eigen::Map<Eigen::Vector3d>{residuals} = weight_ * (point - seen_);
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<PoseJacobian<3>> out(jacobians[0]);
      out << -weight_ * body_from_map, weight_ * Cross(point), Eigen::Vector3d::Zero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<PoseJacobian<3>> out(jacobians[1]);
      out.setZero();
      out.leftCols<3>() = weight_ * body_from_map;
    }
    return true;
  }

 private:
  Eigen::Vector3d seen_;
  double weight_;
};

class GravityFactor final : public ceres::SizedCostFunction<2, kPoseSize> {
 public:
  GravityFactor(const Eigen::Vector3d& up_in_body, double sigma_rad) : up_(up_in_body), weight_(1 / sigma_rad) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Vector3d up = OrientationOf(parameters[0]).conjugate() * Eigen::Vector3d::UnitZ();
    Eigen::Map<Eigen::Vector2d> out(residuals);
    out = weight_ * (up - up_).head<2>();
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Map<PoseJacobian<2>> jacobian(jacobians[0]);
    jacobian.setZero();
    jacobian.middleCols<3>(3) = weight_ * Cross(up).topRows<2>();
    return true;
  }

 private:
  Eigen::Vector3d up_;
  double weight_;
};

class PosePriorFactor final : public ceres::SizedCostFunction<6, kPoseSize> {
 public:
  explicit PosePriorFactor(const PosePrior& prior)
      : prior_(prior.map_from_node),
        position_weight_(1 / prior.sigma_m),
        turn_weights_(1 / prior.sigma_tilt_rad, 1 / prior.sigma_tilt_rad, 1 / prior.sigma_yaw_rad) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Quaterniond error = WithPositiveW(OrientationOf(parameters[0]) * prior_.orientation.conjugate());
    Eigen::Map<Vector6d> out(residuals);
    out << position_weight_ * (PositionOf(parameters[0]) - prior_.position_m),
        2 * turn_weights_.cwiseProduct(error.vec());
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Map<PoseJacobian<6>> jacobian(jacobians[0]);
    jacobian.setZero();
    jacobian.topLeftCorner<3, 3>() = position_weight_ * Eigen::Matrix3d::Identity();
    jacobian.block<3, 3>(3, 3) = turn_weights_.asDiagonal() *
                                 (error.w() * Eigen::Matrix3d::Identity() + Cross(error.vec())) *
                                 prior_.orientation.toRotationMatrix();
    return true;
  }

 private:
  Pose prior_;
  double position_weight_;
  Eigen::Vector3d turn_weights_;
};

class ZeroPriorFactor final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit ZeroPriorFactor(double sigma) : weight_(1 / sigma) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = weight_ * parameters[0][0];
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = weight_;
    return true;
  }

 private:
  double weight_;
};

}  // namespace

PoseBlock ToBlock(const Pose& pose) {
  const Eigen::Vector3d& p = pose.position_m;
  const Eigen::Quaterniond& q = pose.orientation;
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

Pose FromBlock(const PoseBlock& block) { return Pose{PositionOf(block.data()), OrientationOf(block.data())}; }

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Eigen::Vector3d> turn(delta + 3);
  const double angle = turn.norm();
  // Below 1e-8, sin(a/2)/a equals 1/2 up to rounding.
  const double ratio = angle < 1e-8 ? 0.5 : std::sin(angle / 2) / angle;
  Eigen::Quaterniond step;
  step.w() = std::cos(angle / 2);
  step.vec() = ratio * turn;
  Eigen::Map<Eigen::Vector3d>{x_plus_delta} = PositionOf(x) + PositionOf(delta);
  Eigen::Map<Eigen::Quaterniond>{x_plus_delta + 3} = (OrientationOf(x) * step).normalized();
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kPoseSize, kPoseTangentSize, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::Quaterniond turn = WithPositiveW(OrientationOf(x).conjugate() * OrientationOf(y));
  const double sine = turn.vec().norm();
  const double ratio = sine < 1e-8 ? 2 : 2 * std::atan2(sine, turn.w()) / sine;
  Eigen::Map<Eigen::Vector3d>{y_minus_x} = PositionOf(y) - PositionOf(x);
  Eigen::Map<Eigen::Vector3d>{y_minus_x + 3} = ratio * turn.vec();
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kPoseTangentSize, kPoseSize, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

std::vector<int> AxesOf(BodyFreedom freedom, bool is_point) {
  if (freedom == BodyFreedom::kPlanar) return is_point ? std::vector<int>{0, 1} : std::vector<int>{0, 1, 5};
  if (is_point) return {0, 1, 2};
  return freedom == BodyFreedom::kUpright ? std::vector<int>{0, 1, 2, 5} : std::vector<int>{0, 1, 2, 3, 4, 5};
}

bool AxesManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  std::array<double, kPoseTangentSize> whole{};
  for (std::size_t i = 0; i < axes_.size(); ++i) whole[static_cast<std::size_t>(axes_[i])] = delta[i];
  return PoseManifold().Plus(x, whole.data(), x_plus_delta);
}

bool AxesManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(jacobian, kPoseSize,
                                                                                         TangentSize());
  out.setZero();
  for (int i = 0; i < TangentSize(); ++i) out(axes_[static_cast<std::size_t>(i)], i) = 1;
  return true;
}

bool AxesManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  std::array<double, kPoseTangentSize> whole{};
  PoseManifold().Minus(y, x, whole.data());
  for (std::size_t i = 0; i < axes_.size(); ++i) y_minus_x[i] = whole[static_cast<std::size_t>(axes_[i])];
  return true;
}

bool AxesManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(jacobian, TangentSize(),
                                                                                         kPoseSize);
  out.setZero();
  for (int i = 0; i < TangentSize(); ++i) out(i, axes_[static_cast<std::size_t>(i)]) = 1;
  return true;
}

std::unique_ptr<ceres::CostFunction> MakeOdometryFactor(const Pose& from_from_to, const Matrix6d& covariance) {
  return std::make_unique<OdometryFactor>(from_from_to, covariance);
}

std::unique_ptr<ceres::CostFunction> MakeRangeFactor(double range_m, double sigma_m, const Eigen::Vector3d& antenna_a_m,
                                                     const Eigen::Vector3d& antenna_b_m) {
  return std::make_unique<RangeFactor>(range_m, sigma_m, antenna_a_m, antenna_b_m);
}

std::unique_ptr<ceres::CostFunction> MakeSightingFactor(const Eigen::Vector3d& from_point_m, double sigma_m) {
  return std::make_unique<SightingFactor>(from_point_m, sigma_m);
}

std::unique_ptr<ceres::CostFunction> MakeGravityFactor(const Eigen::Vector3d& up_in_body, double sigma_rad) {
  return std::make_unique<GravityFactor>(up_in_body, sigma_rad);
}

std::unique_ptr<ceres::CostFunction> MakePosePriorFactor(const PosePrior& prior) {
  return std::make_unique<PosePriorFactor>(prior);
}

std::unique_ptr<ceres::CostFunction> MakeZeroPriorFactor(double sigma) {
  return std::make_unique<ZeroPriorFactor>(sigma);
}

}  // namespace moondb
