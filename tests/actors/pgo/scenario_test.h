// ScenarioTest: base class of tests that solve a scenario on one thread.
#pragma once

#include <gtest/gtest.h>

#include <random>

#include "actors/pgo/pose_graph_solver.h"
#include "tests/actors/pgo/scenario.h"

namespace moondb::simulation {

class ScenarioTest : public testing::Test {
 protected:
  // Solves the scenario's graph. The test fails if the solution is not accepted.
  Solution Solve(const LastSolution& last = {}) const {
    SolverOptions options;
    options.thread_count = 1;
    Solution solution = SolvePoseGraph(scenario_.graph, scenario_.agents, last, options);
    EXPECT_TRUE(solution.is_accepted) << solution.text;
    return solution;
  }

  double ErrorM(const Solution& solution) const { return TrajectoryErrorM(scenario_, solution.poses); }

  Scenario scenario_;
  std::mt19937_64 rng_;  // Generator of measurements that are added to the scenario.
};

}  // namespace moondb::simulation
