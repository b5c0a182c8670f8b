// Tests the solver on missions with real maps and poses. Requires: the environment variable MOONDB_DATA names the
// folder of the missions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/team_facts.h"
#include "model/metrics.h"
#include "model/mission.h"
#include "model/node_poses.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

struct RealMission {
  const char* folder;
  double error_max_m;
  double carried_max_m;  // Error of carried poses.
};

class RealMissionsTest : public testing::TestWithParam<RealMission> {
 protected:
  void SetUp() override {
    const char* data = std::getenv("MOONDB_DATA");
    if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no real missions to solve";
    Result<Mission> mission = ReadMission(std::filesystem::path(data) / GetParam().folder);
    ASSERT_TRUE(mission) << ToString(mission.error());
    mission_ = *std::move(mission);
    options_.thread_count = 1;
  }

  Mission mission_;
  SolverOptions options_;
};

INSTANTIATE_TEST_SUITE_P(Missions, RealMissionsTest,
                         testing::Values(RealMission{"intel_team", 0.32, 0.3}, RealMission{"orebro_team", 0.40, 0.4}));

// The mission's graph as it is known at a time.
PoseGraph GraphAt(const Mission& mission, std::int64_t now_ns) {
  PoseGraph graph = mission.graph;
  const auto is_late = [now_ns](const auto& item) { return item.timestamp_ns > now_ns; };
  std::erase_if(graph.nodes, is_late);
  std::erase_if(graph.odometry, is_late);
  std::erase_if(graph.ranges, is_late);
  return graph;
}

std::int64_t EndOf(const Mission& mission) {
  std::int64_t end_ns = 0;
  for (const GraphNode& node : mission.graph.nodes) end_ns = std::max(end_ns, node.timestamp_ns);
  return end_ns;
}

// Root mean square, over all poses added.
class ErrorSum {
 public:
  void Add(const Pose& pose, const Pose& truth) {
    sum_m2_ += (pose.position_m - truth.position_m).squaredNorm();
    ++count_;
  }
  double Rms() const { return std::sqrt(sum_m2_ / count_); }

 private:
  double sum_m2_ = 0;
  int count_ = 0;
};

TEST_P(RealMissionsTest, EndsNearTheTruth) {
  const AgentFactsMap agents = FactsOf(mission_);
  const std::vector<AgentId> rovers = RoverIds(mission_);
  const Solution solution = SolvePoseGraph(mission_.graph, agents, {}, options_);
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_TRUE(solution.left_out.empty());

  const double odometry_m = CompareTrajectories(PosesOf(mission_.graph), mission_.truth, rovers).rmse_m;
  const double solved_m = CompareTrajectories(solution.poses, mission_.truth, rovers).rmse_m;
  std::cout << GetParam().folder << ": error " << odometry_m << " m by odometry, " << solved_m << " m solved; "
            << solution.CountOf(FactorKind::kRange).rejected << " of " << solution.verdicts.size()
            << " ranges rejected\n";
  EXPECT_GT(odometry_m, 1);
  EXPECT_LT(solved_m, GetParam().error_max_m);
}

// Solves repeatedly, as a leader does after each sync.
TEST_P(RealMissionsTest, EndsNearTheTruthSolveBySolve) {
  const std::int64_t end_ns = EndOf(mission_);
  LastSolution last;
  constexpr int kSolves = 15;
  for (int solve = 1; solve <= kSolves; ++solve) {
    const PoseGraph graph = GraphAt(mission_, end_ns / kSolves * solve + kSolves);
    const Solution solution = SolvePoseGraph(graph, FactsOf(mission_), last, options_);
    ASSERT_TRUE(solution.is_accepted) << solution.text;
    last = ToLast(solution);
  }
  const double solved_m = CompareTrajectories(last.poses, mission_.truth, RoverIds(mission_)).rmse_m;
  std::cout << GetParam().folder << ": error " << solved_m << " m after " << kSolves << " solves\n";
  EXPECT_LT(solved_m, GetParam().error_max_m);
}

// Carries the poses of a solve of the whole mission on by odometry, in each minute of its second half, and compares
// them with that solve: only a minute of odometry lies between.
TEST_P(RealMissionsTest, NodesOfTheMinuteAfterASolveLieWhereTheNextSolveMovesThem) {
  constexpr std::int64_t kMinute_ns = 60'000'000'000;
  const Solution solution = SolvePoseGraph(mission_.graph, FactsOf(mission_), {}, options_);
  ErrorSum raw, carried;
  for (std::int64_t now_ns = EndOf(mission_) / 2; now_ns < EndOf(mission_); now_ns += kMinute_ns) {
    NodePoses poses(10'000);
    std::uint64_t seq = 0;
    for (const GraphNode& node : GraphAt(mission_, now_ns + kMinute_ns).nodes) {
      poses.AddRaw({{node.key.agent, 1, proto::POSE_GRAPH_NODE}, ++seq}, node.key, node.map_from_node);
      if (node.timestamp_ns > now_ns) continue;
      poses.AddOptimized({{1, 1, proto::OPTIMIZED_POSE}, seq}, node.key, {solution.poses.at(node.key)}, {}, 1);
    }
    const NodePoses::ValidPoses valid = poses.FindValid({});
    EXPECT_TRUE(valid.cut_at.empty());
    for (const auto& [node, pose] : valid.poses) {
      if (pose.source != PoseSource::kCarried) continue;
      carried.Add(pose.map_from_node, solution.poses.at(node));
      raw.Add(*poses.FindRaw(node, /*is_quarantined=*/false), solution.poses.at(node));
    }
  }
  std::cout << GetParam().folder << ": the next solve moves nodes by " << raw.Rms() << " m from raw poses, by "
            << carried.Rms() << " m from carried poses\n";
  EXPECT_GT(raw.Rms(), 4 * carried.Rms());
  EXPECT_LT(carried.Rms(), GetParam().carried_max_m);
}

}  // namespace
}  // namespace moondb
