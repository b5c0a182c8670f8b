// The solver on missions whose maps and poses are real. Needs the folder that MOONDB_DATA names.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "actors/pgo/pose_graph_solver.h"
#include "model/metrics.h"
#include "model/mission.h"

namespace moondb {
namespace {

class RealMissionsTest : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Missions, RealMissionsTest, testing::Values("intel_team", "orebro_team"));

TEST_P(RealMissionsTest, EndsWithinHalfAMetreOfTheTruth) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no real missions to solve";
  const Result<Mission> mission = ReadMission(std::filesystem::path(data) / GetParam());
  ASSERT_TRUE(mission) << ToString(mission.error());
  AgentFactsMap agents;
  std::vector<AgentId> rovers;
  for (const MissionAgent& agent : mission->agents) {
    agents[agent.id] = AgentFacts{
        agent.id, agent.is_base_station, agent.start, agent.start_sigma_m, agent.start_sigma_rad, agent.antenna_m};
    if (!agent.is_base_station) rovers.push_back(agent.id);
  }
  SolverOptions options;
  options.thread_count = 1;
  const Solution solution = SolvePoseGraph(mission->graph, agents, {}, options);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_TRUE(solution.left_out.empty());

  const double odometry_m = CompareTrajectories(PosesOf(mission->graph), mission->truth, rovers).rmse_m;
  const double solved_m = CompareTrajectories(solution.poses, mission->truth, rovers).rmse_m;
  std::cout << GetParam() << ": error " << odometry_m << " m by odometry, " << solved_m << " m solved; "
            << solution.rejected_range_count << " of " << solution.ranges.size() << " ranges rejected\n";
  EXPECT_GT(odometry_m, 1);
  EXPECT_LT(solved_m, 0.45);
}

}  // namespace
}  // namespace moondb
