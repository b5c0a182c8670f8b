#include "actors/pgo/standalone_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "actors/pgo/chordal.h"

namespace moondb {
namespace {

// A graph without noise: each robot drives a circle of its own, in the plane or in space. The cost F of the true poses
// is 0.
class Drive {
 public:
  explicit Drive(bool is_planar) { graph_.is_planar = is_planar; }

  // Adds a robot. Returns the indices of its nodes in the graph.
  std::vector<std::size_t> AddRobot(AgentId agent, const Pose& start, int count) {
    std::vector<std::size_t> nodes;
    const double climb_m = graph_.is_planar ? 0 : 0.1;
    const Eigen::Quaterniond bank(Eigen::AngleAxisd(graph_.is_planar ? 0 : 0.05, Eigen::Vector3d::UnitX()));
    Pose step = Pose::FromPlanar(1, 0.1, 0.15 + 0.02 * agent);
    step.position_m.z() = climb_m;
    step.orientation = step.orientation * bank;
    Pose pose = start;
    for (int i = 0; i < count; ++i) {
      nodes.push_back(graph_.nodes.size());
      graph_.nodes.push_back({NodeKey{agent, static_cast<std::uint64_t>(i)}, pose, i, false, false});
      if (i > 0) graph_.steps.push_back({nodes[nodes.size() - 2], nodes.back(), step, 100, 50});
      pose = pose * step;
    }
    return nodes;
  }

  std::size_t AddPoint(const Eigen::Vector3d& at) {
    graph_.nodes.push_back(
        {NodeKey{50, graph_.nodes.size()}, Pose{at, Eigen::Quaterniond::Identity()}, 0, true, false});
    return graph_.nodes.size() - 1;
  }

  void Close(std::size_t from, std::size_t to) {
    const Pose step = graph_.nodes[from].vertex.Inverse() * graph_.nodes[to].vertex;
    graph_.steps.push_back({from, to, step, 100, 50});
  }

  void Range(std::size_t from, std::size_t to) {
    const double range_m = (graph_.nodes[from].vertex.position_m - graph_.nodes[to].vertex.position_m).norm();
    graph_.ranges.push_back({from, to, range_m, 0.1});
  }

  void Sight(std::size_t from, std::size_t to) {
    graph_.sightings.push_back(
        {from, to, graph_.nodes[from].vertex.Inverse() * graph_.nodes[to].vertex.position_m, 30});
  }

  StandaloneGraph& graph() { return graph_; }

 private:
  StandaloneGraph graph_;
};

PlainOptions OneThread() {
  PlainOptions options;
  options.thread_count = 1;
  return options;
}

// Returns the largest error in the distances from node 0 to the other nodes. Rigid motions do not change these
// distances.
double ShapeErrorM(const StandaloneGraph& graph, const std::vector<Pose>& poses) {
  double error_m = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const double found_m = (poses[i].position_m - poses[0].position_m).norm();
    const double true_m = (graph.nodes[i].vertex.position_m - graph.nodes[0].vertex.position_m).norm();
    error_m = std::max(error_m, std::abs(found_m - true_m));
  }
  return error_m;
}

class StandaloneSolverTest : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, StandaloneSolverTest, testing::Bool());

TEST_P(StandaloneSolverTest, RelaxesLoopsExactlyWithoutNoise) {
  Drive drive(GetParam());
  const std::vector<std::size_t> nodes = drive.AddRobot(1, Pose{}, 60);
  for (std::size_t i = 0; i + 20 < nodes.size(); i += 5) drive.Close(nodes[i], nodes[i + 20]);
  const ActiveNodes all(nodes.size(), true);
  const std::vector<std::size_t> heads = FindHeads(drive.graph(), all);
  EXPECT_TRUE(HasLoops(drive.graph(), all, heads));
  const PlainState state = ChordalParts(drive.graph(), all, heads);
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    const Pose truth = drive.graph().nodes[node].vertex;
    EXPECT_LT((FromBlock(state[node]).position_m - truth.position_m).norm(), 1e-6);
    EXPECT_LT(FromBlock(state[node]).orientation.angularDistance(truth.orientation), 1e-6);
  }
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_EQ(solution.initial_values, PlainInitialValues::kChordal);
  EXPECT_LT(solution.cost, 1e-9);
}

TEST_P(StandaloneSolverTest, ArrangesRobotsThatOnlyRangesConnect) {
  Drive drive(GetParam());
  const auto a = drive.AddRobot(1, Pose{}, 40);
  const auto b = drive.AddRobot(2, Pose::FromPlanar(15, -8, 2), 40);
  const std::size_t anchor = drive.AddPoint({4, 9, GetParam() ? 0.0 : 1.0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    drive.Range(a[i], b[i]);
    drive.Range(b[i], anchor);
    drive.Range(a[i], anchor);
  }
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_LT(solution.cost, 1e-6);
  EXPECT_LT(ShapeErrorM(drive.graph(), solution.poses), 0.01);
  EXPECT_GT(SolveFromOdometry(drive.graph(), OneThread()).cost, 1) << "the case is too easy to show anything";
}

TEST_P(StandaloneSolverTest, JoinsRobotsByCommonlySightedPoints) {
  Drive drive(GetParam());
  const auto a = drive.AddRobot(1, Pose{}, 30);
  const auto b = drive.AddRobot(2, Pose::FromPlanar(15, -8, 2), 30);
  for (const double x : {2.0, 5.0, 9.0, 12.0}) {
    const std::size_t point = drive.AddPoint({x, 3 + 0.5 * x, GetParam() ? 0 : 0.2 * x * x});
    for (std::size_t i = 0; i < a.size(); i += 7) {
      drive.Sight(a[i], point);
      drive.Sight(b[i], point);
    }
  }
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_LT(solution.cost, 1e-9);
  EXPECT_LT(ShapeErrorM(drive.graph(), solution.poses), 1e-4);
}

TEST_P(StandaloneSolverTest, DoesNotMoveFixedNodes) {
  Drive drive(GetParam());
  const auto nodes = drive.AddRobot(1, Pose::FromPlanar(3, 4, 1), 20);
  drive.Close(nodes[0], nodes[19]);
  drive.graph().nodes[nodes[7]].is_fixed = true;
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  for (const std::size_t node : nodes) {
    EXPECT_LT((solution.poses[node].position_m - drive.graph().nodes[node].vertex.position_m).norm(), 1e-6);
  }
}

TEST_P(StandaloneSolverTest, SolvesDisconnectedParts) {
  Drive drive(GetParam());
  drive.AddRobot(1, Pose{}, 10);
  const auto b = drive.AddRobot(2, Pose::FromPlanar(15, -8, 2), 10);
  drive.AddPoint({1, 1, 0});
  drive.Close(b[0], b[9]);
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_LT(solution.cost, 1e-9);
  EXPECT_EQ(solution.poses.size(), 21u);
  EXPECT_EQ(solution.text, "3 parts that no edge joins: their poses relative to each other are unknown");
}

// The graph has only landmarks, which are connected by ranges.
TEST_P(StandaloneSolverTest, SolvesAGraphOfPointsOnly) {
  Drive drive(GetParam());
  const double height_m = GetParam() ? 0 : 2;
  std::vector<std::size_t> points;
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(0, 0, 0), {4, 0, 0}, {0, 3, height_m}, {5, 4, 0}, {1, 7, height_m}}) {
    points.push_back(drive.AddPoint(at));
    for (std::size_t i = 0; i + 1 < points.size(); ++i) drive.Range(points[i], points.back());
  }
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged) << solution.text;
  EXPECT_LT(solution.cost, 1e-6);
  EXPECT_LT(ShapeErrorM(drive.graph(), solution.poses), 0.01);
}

TEST_P(StandaloneSolverTest, ReportsThatAMirroredShapeFitsAsWell) {
  Drive drive(GetParam());
  Pose pose;
  std::vector<std::size_t> nodes;
  for (std::uint64_t i = 0; i < 20; ++i) {  // The robot drives along a straight line.
    nodes.push_back(drive.graph().nodes.size());
    drive.graph().nodes.push_back({NodeKey{1, i}, pose, static_cast<std::int64_t>(i), false, false});
    if (i > 0) drive.graph().steps.push_back({nodes[i - 1], nodes[i], Pose::FromPlanar(1, 0, 0), 100, 50});
    pose = pose * Pose::FromPlanar(1, 0, 0);
  }
  // In space, mirroring a single point at the line is the same as rotating the whole graph. With two points, the
  // mirrored graph has another shape.
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(8, 5, 0), Eigen::Vector3d(12, -3, 0)}) {
    const std::size_t point = drive.AddPoint(at);
    for (const std::size_t node : nodes) drive.Range(node, point);
  }
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_EQ(solution.text, "ambiguous: another solution fits as well");
}

TEST_P(StandaloneSolverTest, SolvesGraphsOfOneAndNoNode) {
  Drive drive(GetParam());
  const PlainSolution nothing = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(nothing.has_converged);
  EXPECT_EQ(nothing.text, "the graph has no node: give a file with vertices");
  drive.AddRobot(1, Pose{}, 1);
  const PlainSolution one = SolveStandaloneGraph(drive.graph(), OneThread());
  EXPECT_TRUE(one.has_converged) << one.text;
  EXPECT_EQ(one.poses.size(), 1u);
}

// With one iteration, the chordal start does not converge. The solver then adds a start from odometry, and a third
// start from the better of the two results.
TEST_P(StandaloneSolverTest, AddsAnOdometryStartIfTheChordalStartDoesNotConverge) {
  Drive drive(GetParam());
  const auto nodes = drive.AddRobot(1, Pose{}, 40);
  drive.Close(nodes[0], nodes[39]);
  drive.graph().steps.back().from_from_to.position_m += Eigen::Vector3d(3, 2, 0);
  PlainOptions options = OneThread();
  options.iterations_max = 1;
  EXPECT_EQ(SolveStandaloneGraph(drive.graph(), options).starts, 3);
  options.iterations_max = 200;
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), options);
  EXPECT_TRUE(solution.has_converged);
  EXPECT_EQ(solution.starts, 1);
}

TEST(StandaloneGraphTest, DerivesVerticesFromEdgesIfTheFileHasNone) {
  const Result<G2o> g2o = ParseG2o("EDGE_SE2 0 5 1 0 0.5 1 0 0 1 0 1\nEDGE_SE2 5 7 2 0 0 1 0 0 1 0 1\n", "graph.g2o");
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  const StandaloneGraph graph = ToStandaloneGraph(*g2o);
  ASSERT_EQ(graph.nodes.size(), 3u);
  EXPECT_EQ(graph.nodes[1].key, (NodeKey{0, 5}));
  const PlainSolution solution = SolveStandaloneGraph(graph, OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_LT((solution.poses[2].position_m - Eigen::Vector3d(1 + 2 * std::cos(0.5), 2 * std::sin(0.5), 0)).norm(), 1e-9);
}

TEST(StandaloneGraphTest, DoesNotReturnAFailedSolveAsTheBest) {
  const std::string unit = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const std::string huge = " 1e120 0 0 0 0 0 1e120 0 0 0 0 1e120 0 0 0 1e120 0 0 1e120 0 1e120\n";
  const std::string text = "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1" + unit + "EDGE_SE3:QUAT 1 2 1 0 0 0 0 0 1" + unit +
                           "EDGE_SE3:QUAT 0 2 5 0 0 0 0 0 1" + huge;
  const Result<G2o> g2o = ParseG2o(text, "graph.g2o");
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  const PlainSolution solution = SolveStandaloneGraph(ToStandaloneGraph(*g2o), OneThread());
  EXPECT_GE(solution.cost, 0);
  EXPECT_EQ(solution.poses.size(), 3u);
  EXPECT_TRUE(solution.has_converged || !solution.text.empty());
}

TEST(StandaloneSolverStopTest, StopsBeforeTheFirstStart) {
  Drive drive(true);
  const auto a = drive.AddRobot(1, Pose{}, 20);
  const auto b = drive.AddRobot(2, Pose::FromPlanar(15, -8, 2), 20);
  for (std::size_t i = 0; i < a.size(); ++i) drive.Range(a[i], b[i]);
  PlainOptions options = OneThread();
  options.stop_requested = [] { return true; };
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), options);
  EXPECT_FALSE(solution.has_converged);
  EXPECT_EQ(solution.text, "stopped");
  EXPECT_EQ(solution.poses.size(), 40u);
  EXPECT_FALSE(std::isfinite(solution.cost)) << "nothing was solved";
}

TEST(StandaloneSolverStopTest, StopsOnRequest) {
  Drive drive(true);
  const auto nodes = drive.AddRobot(1, Pose{}, 20);
  drive.Close(nodes[0], nodes[19]);
  drive.graph().steps.back().from_from_to.position_m.x() += 3;
  PlainOptions options = OneThread();
  options.stop_requested = [] { return true; };
  const PlainSolution solution = SolveStandaloneGraph(drive.graph(), options);
  EXPECT_FALSE(solution.has_converged);
  EXPECT_EQ(solution.text, "stopped");
}

struct PublicSet {
  const char* file;
  double best_cost;  // Lowest known cost. SE-Sync certified it as optimal, except for graphs with ranges.
  double slack;
  int iterations_max = 60;  // Limit for the iterations of all starts together. About twice the number needed.
  InformationCheck check = InformationCheck::kPositiveDefinite;
};

class PublicSetTest : public testing::TestWithParam<PublicSet> {};

INSTANTIATE_TEST_SUITE_P(
    Sets, PublicSetTest,
    testing::Values(PublicSet{"sphere2500.g2o", 1687.0058, 1e-6}, PublicSet{"torus3D.g2o", 24227.0456, 1e-6},
                    PublicSet{"parking-garage.g2o", 1.262524, 2e-6}, PublicSet{"tiers.pyfg", 4100.2026, 1e-6, 40},
                    PublicSet{"ais2klinik.g2o", 188.501806, 1e-6, 20},
                    PublicSet{"cubicle.g2o", 717.125992, 1e-6, 60, InformationCheck::kBlocks},
                    PublicSet{"plaza2.pyfg", 1468.65579, 1e-6, 100}, PublicSet{"mrclam3b.pyfg", 2220.886106, 1e-6, 300},
                    PublicSet{"mrclam5a.pyfg", 138.2071, 1e-6, 300}));

TEST_P(PublicSetTest, ReachesTheBestKnownCost) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no public graphs to solve";
  const std::filesystem::path file = std::filesystem::path(data) / "pose_graphs" / GetParam().file;
  StandaloneGraph graph;
  if (file.extension() == ".g2o") {
    const Result<G2o> g2o = ReadG2o(file, {.check = GetParam().check});
    ASSERT_TRUE(g2o) << ToString(g2o.error());
    graph = ToStandaloneGraph(*g2o);
  } else {
    const Result<Pyfg> pyfg = ReadPyfg(file);
    ASSERT_TRUE(pyfg) << ToString(pyfg.error());
    graph = ToStandaloneGraph(*pyfg);
  }
  const PlainSolution solution = SolveStandaloneGraph(graph, OneThread());
  EXPECT_TRUE(solution.has_converged);
  EXPECT_LE(solution.cost, GetParam().best_cost * (1 + GetParam().slack));
  EXPECT_LE(solution.iterations, GetParam().iterations_max);
}

}  // namespace
}  // namespace moondb
