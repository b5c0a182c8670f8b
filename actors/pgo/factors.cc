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

// An odometry step, with a scale as the third block, or a loop closure without one.
class RelativePoseFactor final : public ceres::CostFunction {
 public:
  RelativePoseFactor(const Pose& from_from_to, const Matrix6d& covariance, bool has_scale)
      : step_(from_from_to), step_inverse_(from_from_to.orientation.conjugate()), has_scale_(has_scale) {
    set_num_residuals(6);
    *mutable_parameter_block_sizes() = {kPoseSize, kPoseSize};
    if (has_scale) mutable_parameter_block_sizes()->push_back(1);
    // covariance = L L^T, so W = L^-1 has W^T W = covariance^-1.
    whitener_ = Eigen::LLT<Matrix6d>(covariance).matrixL().solve(Matrix6d::Identity());
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Quaterniond from = OrientationOf(parameters[0]);
    const Eigen::Quaterniond to = OrientationOf(parameters[1]);
    const double scale = has_scale_ ? 1 + parameters[2][0] : 1;
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
    if (has_scale_ && jacobians[2] != nullptr) {
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
  bool has_scale_;
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

class PriorFactor final : public ceres::CostFunction {
 public:
  explicit PriorFactor(const NodePrior& prior)
      : prior_(prior), size_(static_cast<int>(prior.extent)), yaw_rad_(prior.map_from_node.Yaw()) {
    set_num_residuals(size_);
    *mutable_parameter_block_sizes() = {kPoseSize};
    const Eigen::MatrixXd covariance = prior.covariance.topLeftCorner(size_, size_);
    whitener_ = Eigen::LLT<Eigen::MatrixXd>(covariance).matrixL().solve(Eigen::MatrixXd::Identity(size_, size_));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Quaterniond orientation = OrientationOf(parameters[0]);
    const Eigen::Matrix3d rotation = orientation.toRotationMatrix();
    Vector6d raw = Vector6d::Zero();
    Matrix6d j = Matrix6d::Zero();
    raw.head<3>() = PositionOf(parameters[0]) + rotation * prior_.point_m - prior_.map_from_node.position_m;
    j.topLeftCorner<3, 3>().setIdentity();
    j.topRightCorner<3, 3>() = -rotation * Cross(prior_.point_m);
    if (prior_.extent == PriorExtent::kPositionYaw) {
      const double cosine = rotation(0, 0);
      const double sine = rotation(1, 0);
      raw(3) = std::remainder(std::atan2(sine, cosine) - yaw_rad_, 2 * M_PI);
      // The derivative of the body's x axis by the perturbation is R (0, dtheta_z, -dtheta_y). The yaw of a body whose
      // x axis is vertical is undefined; its Jacobian is then zero.
      const double square = cosine * cosine + sine * sine;
      if (square > kZeroDistance_m) {
        j(3, 4) = (sine * rotation(0, 2) - cosine * rotation(1, 2)) / square;
        j(3, 5) = (cosine * rotation(1, 1) - sine * rotation(0, 1)) / square;
      }
    }
    if (prior_.extent == PriorExtent::kPose) {
      const Eigen::Quaterniond error = WithPositiveW(orientation * prior_.map_from_node.orientation.conjugate());
      raw.tail<3>() = 2 * error.vec();
      j.bottomRightCorner<3, 3>() = (error.w() * Eigen::Matrix3d::Identity() + Cross(error.vec())) *
                                    prior_.map_from_node.orientation.toRotationMatrix();
    }
    Eigen::Map<Eigen::VectorXd>(residuals, size_) = whitener_ * raw.head(size_);
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kPoseSize, Eigen::RowMajor>> out(jacobians[0], size_, kPoseSize);
    out.leftCols<6>() = whitener_ * j.topRows(size_);
    out.col(6).setZero();
    return true;
  }

 private:
  NodePrior prior_;
  int size_;
  double yaw_rad_;
  Eigen::MatrixXd whitener_;
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
  return std::make_unique<RelativePoseFactor>(from_from_to, covariance, /*has_scale=*/true);
}

std::unique_ptr<ceres::CostFunction> MakeLoopClosureFactor(const Pose& from_from_to, const Matrix6d& covariance) {
  return std::make_unique<RelativePoseFactor>(from_from_to, covariance, /*has_scale=*/false);
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

std::unique_ptr<ceres::CostFunction> MakePriorFactor(const NodePrior& prior) {
  return std::make_unique<PriorFactor>(prior);
}

std::unique_ptr<ceres::CostFunction> MakeZeroPriorFactor(double sigma) {
  return std::make_unique<ZeroPriorFactor>(sigma);
}

}  // namespace moondb
