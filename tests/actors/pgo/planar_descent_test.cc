#include "actors/pgo/planar_descent.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

namespace moondb {
namespace {

// Four poses and two points, with steps, sightings and ranges between every combination of node types.
StandaloneGraph SmallGraph() {
  StandaloneGraph graph;
  graph.is_planar = true;
  graph.nodes.resize(6);
  graph.nodes[4].is_point = graph.nodes[5].is_point = true;
  graph.steps = {{0, 1, Pose::FromPlanar(1, 0.2, 0.4), 30, 20},
                 {1, 2, Pose::FromPlanar(1.5, -0.3, 0.9), 50, 10},
                 {3, 2, Pose::FromPlanar(0.7, 2, -0.8), 5, 40},
                 {0, 3, Pose::FromPlanar(2, 1, 2.5), 15, 8}};
  graph.sightings = {{1, 4, {2, 1, 0}, 7}, {3, 4, {-1, 1.5, 0}, 9}};
  graph.ranges = {{0, 2, 3, 0.2}, {5, 1, 2, 0.3}, {4, 5, 1.5, 0.5}, {3, 5, 2.5, 0.4}};
  return graph;
}

PlanarState RandomState(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-3, 3);
  PlanarState state;
  for (std::size_t node = 0; node < count; ++node) state.emplace_back(any(random), any(random), any(random));
  return state;
}

std::vector<bool> AllBut(std::size_t count, std::size_t standing) {
  std::vector<bool> free(count, true);
  free[standing] = false;
  return free;
}

class PlanarSystemTest : public testing::TestWithParam<unsigned> {
 protected:
  PlanarSystemTest() { SCOPED_TRACE("seed " + std::to_string(GetParam())); }

  const StandaloneGraph graph_ = SmallGraph();
  PlanarSystem system_{graph_, std::vector<bool>(6, true), AllBut(6, 1)};
  PlanarState state_ = RandomState(6, GetParam());
};

INSTANTIATE_TEST_SUITE_P(Seeds, PlanarSystemTest, testing::Range(1u, 9u));

TEST_P(PlanarSystemTest, DerivativesMatchTheCost) {
  constexpr double kStep = 1e-6;
  system_.Linearise(state_, Curvature::kExact);
  const Eigen::VectorXd gradient = system_.gradient();
  const Eigen::MatrixXd curvature = Eigen::MatrixXd(system_.normal().lower()).selfadjointView<Eigen::Lower>();
  ASSERT_EQ(gradient.size(), 3 * 3 + 2 * 2);
  for (Eigen::Index i = 0; i < gradient.size(); ++i) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(gradient.size(), i);
    const PlanarState ahead = system_.Plus(state_, step);
    const PlanarState behind = system_.Plus(state_, -step);
    // gradient[i] is the derivative of Cost / 2. The two states are 2 * kStep apart, so the difference of their costs
    // is divided by 4 * kStep.
    EXPECT_NEAR((system_.Cost(ahead) - system_.Cost(behind)) / (4 * kStep), gradient[i], 1e-4 * gradient.norm());
    system_.Linearise(ahead, Curvature::kExact);
    const Eigen::VectorXd gradient_ahead = system_.gradient();
    system_.Linearise(behind, Curvature::kExact);
    const Eigen::VectorXd change = (gradient_ahead - system_.gradient()) / (2 * kStep);
    EXPECT_LT((change - curvature.col(i)).norm(), 1e-5 * curvature.norm()) << "unknown " << i;
  }
}

TEST_P(PlanarSystemTest, GaussNewtonCurvatureIsNeverIndefinite) {
  system_.Linearise(state_, Curvature::kGaussNewton);
  const Eigen::MatrixXd curvature = Eigen::MatrixXd(system_.normal().lower()).selfadjointView<Eigen::Lower>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> values(curvature, Eigen::EigenvaluesOnly);
  EXPECT_GT(values.eigenvalues().minCoeff(), -1e-9 * values.eigenvalues().maxCoeff());
}

TEST_P(PlanarSystemTest, VariableProjectionNeverRaisesTheCost) {
  const PlanarState before = state_;
  const double cost = system_.Cost(state_);
  double last = cost;
  for (int round = 0; round < 5; ++round) {
    system_.SettlePositions(state_);
    EXPECT_LE(system_.Cost(state_), last * (1 + 1e-12));
    last = system_.Cost(state_);
  }
  EXPECT_LT(last, 0.9 * cost);
  EXPECT_EQ(state_[1], before[1]) << "it stands";
  for (std::size_t node = 0; node < 4; ++node) EXPECT_EQ(state_[node].z(), before[node].z());
}

TEST(PlanarSystemPartTest, EdgesOfInactiveNodesDoNotCount) {
  StandaloneGraph graph = SmallGraph();
  const PlanarState state = RandomState(6, 3);
  std::vector<bool> active(6, true);
  active[3] = active[5] = false;
  const PlanarSystem part(graph, active, active);
  std::erase_if(graph.steps, [](const PlainStep& step) { return step.from == 3 || step.to == 3; });
  std::erase_if(graph.sightings, [](const PlainSighting& sighting) { return sighting.from == 3; });
  graph.ranges.resize(1);
  const PlanarSystem alone(graph, std::vector<bool>(6, true), active);
  EXPECT_GT(alone.Cost(state), 0);
  EXPECT_DOUBLE_EQ(part.Cost(state), alone.Cost(state));
}

// Returns a chain of `count` poses with one loop closure of a wrong length. To reach the minimum, the far poses must
// move along a narrow valley of the cost.
StandaloneGraph LongLoop(int count) {
  StandaloneGraph graph;
  graph.is_planar = true;
  graph.nodes.resize(static_cast<std::size_t>(count));
  for (std::size_t i = 1; i < graph.nodes.size(); ++i) {
    const double turn_rad = (i / 100) % 2 == 0 ? 0.02 : -0.01;
    graph.steps.push_back({i - 1, i, Pose::FromPlanar(1, 0, turn_rad), 1e4, 1e4});
  }
  graph.steps.push_back({graph.nodes.size() - 1, 0, Pose::FromPlanar(5, 30, 1), 1e4, 1e4});
  return graph;
}

// Returns the poses that result from the chain's steps, starting at the first node.
PlanarState Composed(const StandaloneGraph& graph) {
  PlanarState state(graph.nodes.size(), Eigen::Vector3d::Zero());
  Pose pose;
  for (std::size_t i = 1; i < state.size(); ++i) {
    pose = pose * graph.steps[i - 1].from_from_to;
    state[i] = {pose.position_m.x(), pose.position_m.y(), pose.Yaw()};
  }
  return state;
}

TEST(PlanarDescentTest, CrossesALongValleyInFewSteps) {
  const StandaloneGraph graph = LongLoop(2'000);
  PlanarState state = Composed(graph);
  PlanarSystem system(graph, std::vector<bool>(state.size(), true), AllBut(state.size(), 0));
  const PlanarDescent descent = MinimisePlanar(system, {}, state);
  EXPECT_TRUE(descent.has_converged);
  EXPECT_DOUBLE_EQ(descent.cost, system.Cost(state));
  system.Linearise(state, Curvature::kExact);
  EXPECT_LT(system.gradient().norm(), 1e-3);
  EXPECT_LT(descent.iterations, 80);
}

// Contradictory edges leave large residuals. Gauss-Newton steps then differ strongly from Newton steps.
TEST(PlanarDescentTest, ConvergesInFewStepsThoughEdgesContradictEachOther) {
  StandaloneGraph graph = LongLoop(60);
  for (PlainStep& step : graph.steps) step.tau = step.kappa = 1;
  for (std::size_t i = 0; i + 20 < graph.nodes.size(); i += 2) {
    const double side = i % 4 == 0 ? 1 : -1;
    graph.steps.push_back({i, i + 20, Pose::FromPlanar(4 + side, 3 * side, 1.2 * side), 1, 1});
  }
  PlanarState state(graph.nodes.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < state.size(); ++i) state[i].x() = static_cast<double>(i);
  PlanarSystem system(graph, std::vector<bool>(state.size(), true), AllBut(state.size(), 0));
  const PlanarDescent descent = MinimisePlanar(system, {}, state);
  EXPECT_TRUE(descent.has_converged);
  EXPECT_GT(descent.cost, 100);
  EXPECT_LT(descent.iterations, 40);
}

// At the minimum, rounding errors in edges with large weights leave a gradient above any fixed tolerance.
TEST(PlanarDescentTest, EndsAtOnceIfOnlyRoundingErrorsRemain) {
  StandaloneGraph graph = LongLoop(500);
  graph.steps.pop_back();
  for (PlainStep& step : graph.steps) step.tau = step.kappa = 1e8;
  PlanarState state = Composed(graph);
  PlanarSystem system(graph, std::vector<bool>(state.size(), true), AllBut(state.size(), 0));
  const PlanarDescent descent = MinimisePlanar(system, {}, state);
  EXPECT_TRUE(descent.has_converged);
  EXPECT_LT(descent.cost, 1e-9);
  EXPECT_LE(descent.iterations, 3);
}

TEST(PlanarDescentTest, ReportsThatItHasNotConverged) {
  const StandaloneGraph graph = SmallGraph();
  const PlanarState start = RandomState(6, 5);
  PlanarSystem system(graph, std::vector<bool>(6, true), AllBut(6, 0));
  PlanarDescentOptions options;
  options.iterations_max = 1;
  PlanarState state = start;
  const PlanarDescent one = MinimisePlanar(system, options, state);
  EXPECT_FALSE(one.has_converged);
  EXPECT_EQ(one.iterations, 1);
  options.iterations_max = 200;
  options.stop_requested = [] { return true; };
  state = start;
  const PlanarDescent stopped = MinimisePlanar(system, options, state);
  EXPECT_FALSE(stopped.has_converged);
  EXPECT_EQ(state, start);
  EXPECT_DOUBLE_EQ(stopped.cost, system.Cost(start));
}

TEST(PlanarDescentTest, RejectsACostThatIsNotANumber) {
  StandaloneGraph graph = SmallGraph();
  graph.steps[0].tau = 1e308;
  PlanarState state = RandomState(6, 5);
  state[0].x() = 1e9;
  PlanarSystem system(graph, std::vector<bool>(6, true), AllBut(6, 0));
  const PlanarDescent descent = MinimisePlanar(system, {}, state);
  EXPECT_FALSE(descent.has_converged);
  EXPECT_FALSE(std::isfinite(descent.cost));
}

}  // namespace
}  // namespace moondb
