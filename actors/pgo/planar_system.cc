#include "actors/pgo/planar_system.h"

#include <cmath>

namespace moondb {

namespace {

constexpr double kZeroLength_m = 1e-9;

Eigen::Vector2d QuarterTurn(const Eigen::Vector2d& v) { return {-v.y(), v.x()}; }

Eigen::Vector2d Turned(const Eigen::Vector2d& v, double yaw_rad) {
  const double cosine = std::cos(yaw_rad);
  const double sine = std::sin(yaw_rad);
  return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y()};
}

std::vector<int> SizesOf(const StandaloneGraph& graph, const std::vector<bool>& active, const std::vector<bool>& free) {
  std::vector<int> sizes;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    const int size = graph.nodes[node].is_point ? 2 : 3;
    sizes.push_back(active[node] && free[node] ? size : 0);
  }
  return sizes;
}

}  // namespace

PlanarSystem::PlanarSystem(const StandaloneGraph& graph, const std::vector<bool>& active, const std::vector<bool>& free)
    : sizes_(SizesOf(graph, active, free)),
      arms_(ArmsOf(graph, active)),
      ranges_(RangesOf(graph, active)),
      normal_(sizes_, Pairs()),
      gradient_(Eigen::VectorXd::Zero(normal_.size())) {}

std::vector<PlanarSystem::Arm> PlanarSystem::ArmsOf(const StandaloneGraph& graph, const std::vector<bool>& active) {
  std::vector<Arm> arms;
  for (const PlainStep& step : graph.steps) {
    if (!active[step.from] || !active[step.to]) continue;
    arms.push_back(
        {step.from, step.to, step.from_from_to.position_m.head<2>(), step.from_from_to.Yaw(), step.tau, step.kappa});
  }
  for (const PlainSighting& sighting : graph.sightings) {
    if (!active[sighting.from] || !active[sighting.to]) continue;
    arms.push_back({sighting.from, sighting.to, sighting.from_point_m.head<2>(), 0, sighting.tau, 0});
  }
  return arms;
}

std::vector<PlanarSystem::Range> PlanarSystem::RangesOf(const StandaloneGraph& graph, const std::vector<bool>& active) {
  std::vector<Range> ranges;
  for (const PlainRange& range : graph.ranges) {
    if (!active[range.from] || !active[range.to]) continue;
    ranges.push_back({range.from, range.to, range.range_m, 1 / (range.sigma_m * range.sigma_m)});
  }
  return ranges;
}

std::vector<BlockMatrix::NodePair> PlanarSystem::Pairs() const {
  std::vector<BlockMatrix::NodePair> pairs;
  for (const Arm& arm : arms_) pairs.emplace_back(arm.from, arm.to);
  for (const Range& range : ranges_) pairs.emplace_back(range.from, range.to);
  return pairs;
}

double PlanarSystem::Cost(const PlanarState& state) const {
  double sum = 0;
  for (const Arm& arm : arms_) {
    const Eigen::Vector2d apart = (state[arm.to] - state[arm.from]).head<2>();
    sum += arm.tau * (apart - Turned(arm.arm_m, state[arm.from].z())).squaredNorm();
    if (arm.kappa == 0) continue;
    // Computes 1 - cos d as 2 sin^2(d / 2), which stays accurate for small d.
    const double half = std::sin((state[arm.to].z() - state[arm.from].z() - arm.turn_rad) / 2);
    sum += 8 * arm.kappa * half * half;
  }
  for (const Range& range : ranges_) {
    const double error_m = (state[range.to] - state[range.from]).head<2>().norm() - range.range_m;
    sum += range.weight * error_m * error_m;
  }
  return sum;
}

void PlanarSystem::Linearise(const PlanarState& state, Curvature curvature) {
  curvature_ = curvature;
  normal_.SetZero();
  gradient_.setZero();
  for (std::size_t arm = 0; arm < arms_.size(); ++arm) LineariseArm(arm, state);
  for (std::size_t range = 0; range < ranges_.size(); ++range) LineariseRange(range, state);
}

void PlanarSystem::LineariseArm(std::size_t arm, const PlanarState& state) {
  const auto& [from, to, arm_m, turn_rad, tau, kappa] = arms_[arm];
  const Eigen::Vector2d turned_m = Turned(arm_m, state[from].z());
  // Derivative of turned_m by the yaw of `from`.
  const Eigen::Vector2d swing_m = QuarterTurn(turned_m);
  const Eigen::Vector2d error_m = (state[to] - state[from]).head<2>() - turned_m;
  const double turn_error_rad = state[to].z() - state[from].z() - turn_rad;
  const double pull = 2 * kappa * std::sin(turn_error_rad);
  const bool is_exact = curvature_ == Curvature::kExact;
  const double stiffness = 2 * kappa * (is_exact ? std::cos(turn_error_rad) : 1);
  const double arm_square = is_exact ? turned_m.dot(turned_m + error_m) : swing_m.squaredNorm();
  AddGradient(from, {-tau * error_m.x(), -tau * error_m.y(), -tau * swing_m.dot(error_m) - pull});
  AddGradient(to, {tau * error_m.x(), tau * error_m.y(), pull});
  Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
  own.diagonal() << tau, tau, tau * arm_square + stiffness;
  own.block<1, 2>(2, 0) = tau * swing_m.transpose();
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  // Rows of `from`, columns of `to`.
  cross.diagonal() << -tau, -tau, -stiffness;
  cross.block<1, 2>(2, 0) = -tau * swing_m.transpose();
  Eigen::Matrix3d other = Eigen::Matrix3d::Zero();
  other.diagonal() << tau, tau, stiffness;
  normal_.AddToNode(from, own.topLeftCorner(sizes_[from], sizes_[from]));
  normal_.AddToNode(to, other.topLeftCorner(sizes_[to], sizes_[to]));
  normal_.AddToPair(arm, cross.topLeftCorner(sizes_[from], sizes_[to]));
}

void PlanarSystem::LineariseRange(std::size_t range, const PlanarState& state) {
  const auto& [from, to, range_m, weight] = ranges_[range];
  const Eigen::Vector2d apart_m = (state[to] - state[from]).head<2>();
  const double distance_m = apart_m.norm();
  // At distance zero the direction is undefined. Its derivative counts as zero.
  if (distance_m <= kZeroLength_m) return;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  direction.head<2>() = apart_m / distance_m;
  const Eigen::Vector3d pull = weight * (distance_m - range_m) * direction;
  AddGradient(from, -pull);
  AddGradient(to, pull);
  Eigen::Matrix3d block = weight * direction * direction.transpose();
  if (curvature_ == Curvature::kExact) {
    const Eigen::Vector2d across = QuarterTurn(direction.head<2>());
    block.topLeftCorner<2, 2>() += weight * (1 - range_m / distance_m) * across * across.transpose();
  }
  normal_.AddToNode(from, block.topLeftCorner(sizes_[from], sizes_[from]));
  normal_.AddToNode(to, block.topLeftCorner(sizes_[to], sizes_[to]));
  normal_.AddToPair(arms_.size() + range, -block.topLeftCorner(sizes_[from], sizes_[to]));
}

void PlanarSystem::AddGradient(std::size_t node, const Eigen::Vector3d& part) {
  if (sizes_[node] > 0) gradient_.segment(normal_.FirstOf(node), sizes_[node]) += part.head(sizes_[node]);
}

PlanarState PlanarSystem::Plus(const PlanarState& state, const Eigen::VectorXd& step) const {
  PlanarState moved = state;
  for (std::size_t node = 0; node < moved.size(); ++node) {
    if (sizes_[node] > 0) moved[node].head(sizes_[node]) += step.segment(normal_.FirstOf(node), sizes_[node]);
  }
  return moved;
}

BlockMatrix PlanarSystem::MakePositions() const {
  std::vector<int> sizes;
  for (const int size : sizes_) sizes.push_back(size > 0 ? 1 : 0);
  BlockMatrix positions(sizes, Pairs());
  std::size_t pair = 0;
  const auto add = [&](const auto& edge, double weight) {
    const BlockMatrix::Block block = BlockMatrix::Block::Constant(1, 1, weight);
    positions.AddToNode(edge.from, block);
    positions.AddToNode(edge.to, block);
    positions.AddToPair(pair++, -block);
  };
  for (const Arm& arm : arms_) add(arm, arm.tau);
  for (const Range& range : ranges_) add(range, range.weight);
  return positions;
}

void PlanarSystem::SettlePositions(PlanarState& state) {
  if (!positions_) {
    positions_.emplace(MakePositions());
    settled_.compute(positions_->lower());
  }
  if (settled_.info() != Eigen::Success) return;
  Eigen::MatrixX2d right = Eigen::MatrixX2d::Zero(positions_->size(), 2);
  // Adds the normal equations of weight |p_to - p_from - apart|^2. Terms with constant positions are moved to the
  // right-hand side.
  const auto add = [&](const auto& edge, double weight, const Eigen::Vector2d& apart_m) {
    const Eigen::Index from = positions_->FirstOf(edge.from);
    const Eigen::Index to = positions_->FirstOf(edge.to);
    if (from >= 0) right.row(from) -= weight * apart_m.transpose();
    if (to >= 0) right.row(to) += weight * apart_m.transpose();
    const Eigen::Vector2d from_m(state[edge.from].x(), state[edge.from].y());
    const Eigen::Vector2d to_m(state[edge.to].x(), state[edge.to].y());
    if (from >= 0 && to < 0) right.row(from) += weight * to_m.transpose();
    if (to >= 0 && from < 0) right.row(to) += weight * from_m.transpose();
  };
  for (const Arm& arm : arms_) add(arm, arm.tau, Turned(arm.arm_m, state[arm.from].z()));
  for (const Range& range : ranges_) {
    const Eigen::Vector2d apart_m = (state[range.to] - state[range.from]).head<2>();
    const double distance_m = apart_m.norm();
    const Eigen::Vector2d direction =
        distance_m > kZeroLength_m ? Eigen::Vector2d(apart_m / distance_m) : Eigen::Vector2d::UnitX();
    add(range, range.weight, range.range_m * direction);
  }
  const Eigen::MatrixX2d places = settled_.solve(right);
  if (!places.allFinite()) return;
  for (std::size_t node = 0; node < state.size(); ++node) {
    if (sizes_[node] > 0) state[node].head<2>() = places.row(positions_->FirstOf(node)).transpose();
  }
}

}  // namespace moondb
