#include "actors/pgo/standalone_cost.h"

#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "actors/pgo/ceres_options.h"
#include "actors/pgo/connected_parts.h"
#include "actors/pgo/planar_descent.h"

namespace moondb {

namespace {

// For StartQuality::kShallow, the maximum number of iterations is multiplied by this factor.
constexpr int kShallowIterations = 5;

// |R_j - R_i R_ij|^2 is twice |2 vec(dq)|^2 (dq: factors.h), so a rotation covariance of 1 / (2 kappa) gives the
// rotation term of F (standalone_graph.h).
Matrix6d CovarianceOf(const PlainStep& step) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(1 / step.tau), Eigen::Vector3d::Constant(1 / (2 * step.kappa));
  return covariance;
}

}  // namespace

StandaloneCost::StandaloneCost(const StandaloneGraph& graph, const PlainOptions& options)
    : graph_(graph), options_(options) {
  if (graph.is_planar) return;
  for (const PlainStep& step : graph.steps) {
    terms_.push_back({MakeOdometryFactor(step.from_from_to, CovarianceOf(step)), step.from, step.to, true});
  }
  for (const PlainSighting& sighting : graph.sightings) {
    terms_.push_back(
        {MakeSightingFactor(sighting.from_point_m, 1 / std::sqrt(sighting.tau)), sighting.from, sighting.to, false});
  }
  const Eigen::Vector3d no_antenna = Eigen::Vector3d::Zero();
  for (const PlainRange& range : graph.ranges) {
    terms_.push_back(
        {MakeRangeFactor(range.range_m, range.sigma_m, no_antenna, no_antenna), range.from, range.to, true});
  }
}

std::vector<std::size_t> StandaloneCost::FindStanding(const ActiveNodes& active) const {
  ConnectedParts parts(graph_.nodes.size());
  const auto join = [&](const auto& edges) {
    for (const auto& edge : edges) {
      if (active[edge.from] && active[edge.to]) parts.Join(edge.from, edge.to);
    }
  };
  join(graph_.steps);
  join(graph_.sightings);
  join(graph_.ranges);
  std::vector<std::size_t> standing;
  std::vector<bool> is_held(graph_.nodes.size(), false);
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (!active[node] || !graph_.nodes[node].is_fixed) continue;
    standing.push_back(node);
    is_held[parts.HeadOf(node)] = true;
  }
  // Poses precede points, so the head of a part that contains a pose is a pose.
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (active[node] && parts.HeadOf(node) == node && !is_held[node]) standing.push_back(node);
  }
  return standing;
}

PlainFit StandaloneCost::Minimise(const ActiveNodes& active, StartQuality quality, PlainState& state) const {
  return graph_.is_planar ? MinimiseInPlane(active, quality, state) : MinimiseInSpace(active, quality, state);
}

PlainFit StandaloneCost::MinimiseInPlane(const ActiveNodes& active, StartQuality quality, PlainState& state) const {
  std::vector<bool> free = active;
  for (const std::size_t node : FindStanding(active)) free[node] = false;
  PlanarSystem system(graph_, active, free);
  PlanarState places;
  for (const PoseBlock& block : state) {
    const Pose pose = FromBlock(block);
    places.emplace_back(pose.position_m.x(), pose.position_m.y(), pose.Yaw());
  }
  PlanarDescentOptions options;
  options.iterations_max = options_.iterations_max * (quality == StartQuality::kShallow ? kShallowIterations : 1);
  options.trust_region_radius = quality == StartQuality::kNear ? kBoldTrustRegion : kCarefulTrustRegion;
  options.stop_requested = options_.stop_requested;
  const PlanarDescent descent = MinimisePlanar(system, options, places);
  for (std::size_t node = 0; node < state.size(); ++node) {
    if (free[node]) state[node] = ToBlock(Pose::FromPlanar(places[node].x(), places[node].y(), places[node].z()));
  }
  const double cost = std::isfinite(descent.cost) ? descent.cost : std::numeric_limits<double>::infinity();
  return {descent.has_converged, cost, descent.iterations};
}

PlainFit StandaloneCost::MinimiseInSpace(const ActiveNodes& active, StartQuality quality, PlainState& state) const {
  AxesManifold pose_manifold(AxesOf(BodyFreedom::kSpatial, /*is_point=*/false));
  AxesManifold point_manifold(AxesOf(BodyFreedom::kSpatial, /*is_point=*/true));
  double zero = 0;
  ceres::Problem problem(BorrowingProblemOptions());
  problem.AddParameterBlock(&zero, 1);
  problem.SetParameterBlockConstant(&zero);
  for (std::size_t node = 0; node < state.size(); ++node) {
    if (!active[node]) continue;
    problem.AddParameterBlock(state[node].data(), kPoseSize,
                              graph_.nodes[node].is_point ? &point_manifold : &pose_manifold);
  }
  for (const std::size_t node : FindStanding(active)) problem.SetParameterBlockConstant(state[node].data());
  for (const Term& term : terms_) {
    if (!active[term.from] || !active[term.to]) continue;
    std::vector<double*> blocks = {state[term.from].data(), state[term.to].data()};
    if (term.has_number) blocks.push_back(&zero);
    problem.AddResidualBlock(term.factor.get(), nullptr, blocks);
  }
  ceres::Solver::Options options = LeastSquaresOptions(options_.thread_count, options_.iterations_max);
  options.initial_trust_region_radius = quality == StartQuality::kNear ? kBoldTrustRegion : kCarefulTrustRegion;
  if (quality == StartQuality::kShallow) {
    options.trust_region_strategy_type = ceres::DOGLEG;
    options.dogleg_type = ceres::SUBSPACE_DOGLEG;
    options.max_num_iterations *= kShallowIterations;
  }
  StopCallback stop(options_.stop_requested);
  if (options_.stop_requested) options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  PlainFit fit;
  fit.has_converged = summary.termination_type == ceres::CONVERGENCE && std::isfinite(summary.final_cost);
  // Ceres reports F / 2, or -1 if it could not evaluate the initial values.
  fit.cost = summary.IsSolutionUsable() ? 2 * summary.final_cost : std::numeric_limits<double>::infinity();
  fit.iterations = static_cast<int>(summary.iterations.size());
  return fit;
}

}  // namespace moondb
