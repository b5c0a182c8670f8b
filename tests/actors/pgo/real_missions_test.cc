// Tests the solver on missions with real maps and poses. Requires: the environment variable MOONDB_DATA names the
// folder of the missions.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/team_facts.h"
#include "model/metrics.h"
#include "model/mission.h"

namespace moondb {
namespace {

struct RealMission {
  const char* folder;
  double error_max_m;
};

class RealMissionsTest : public testing::TestWithParam<RealMission> {};

INSTANTIATE_TEST_SUITE_P(Missions, RealMissionsTest,
                         testing::Values(RealMission{"intel_team", 0.32}, RealMission{"orebro_team", 0.40}));

TEST_P(RealMissionsTest, EndsNearTheTruth) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no real missions to solve";
  const Result<Mission> mission = ReadMission(std::filesystem::path(data) / GetParam().folder);
  ASSERT_TRUE(mission) << ToString(mission.error());
  const AgentFactsMap agents = FactsOf(*mission);
  const std::vector<AgentId> rovers = RoverIds(*mission);
  SolverOptions options;
  options.thread_count = 1;
  const Solution solution = SolvePoseGraph(mission->graph, agents, {}, options);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_TRUE(solution.left_out.empty());

  const double odometry_m = CompareTrajectories(PosesOf(mission->graph), mission->truth, rovers).rmse_m;
  const double solved_m = CompareTrajectories(solution.poses, mission->truth, rovers).rmse_m;
  std::cout << GetParam().folder << ": error " << odometry_m << " m by odometry, " << solved_m << " m solved; "
            << solution.CountOf(FactorKind::kRange).rejected << " of " << solution.verdicts.size()
            << " ranges rejected\n";
  EXPECT_GT(odometry_m, 1);
  EXPECT_LT(solved_m, GetParam().error_max_m);
}

// Solves repeatedly, as a leader does after each sync.
TEST_P(RealMissionsTest, EndsNearTheTruthSolveBySolve) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no real missions to solve";
  const Result<Mission> mission = ReadMission(std::filesystem::path(data) / GetParam().folder);
  ASSERT_TRUE(mission) << ToString(mission.error());
  SolverOptions options;
  options.thread_count = 1;
  std::int64_t end_ns = 0;
  for (const GraphNode& node : mission->graph.nodes) end_ns = std::max(end_ns, node.timestamp_ns);
  LastSolution last;
  constexpr int kSolves = 15;
  for (int solve = 1; solve <= kSolves; ++solve) {
    PoseGraph graph = mission->graph;
    const auto is_late = [&](const auto& item) { return item.timestamp_ns > end_ns / kSolves * solve + kSolves; };
    std::erase_if(graph.nodes, is_late);
    std::erase_if(graph.odometry, is_late);
    std::erase_if(graph.ranges, is_late);
    const Solution solution = SolvePoseGraph(graph, FactsOf(*mission), last, options);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    last = ToLast(solution);
  }
  const double solved_m = CompareTrajectories(last.poses, mission->truth, RoverIds(*mission)).rmse_m;
  std::cout << GetParam().folder << ": error " << solved_m << " m after " << kSolves << " solves\n";
  EXPECT_LT(solved_m, GetParam().error_max_m);
}

}  // namespace
}  // namespace moondb
