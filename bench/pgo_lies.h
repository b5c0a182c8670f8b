// Sixth part of pgo_bench. One rover of a mission inserts false records. Measures how far the poses of the other rovers
// move, and whether the solve names the rover.
#pragma once

#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/mission.h"

namespace moondb {

struct LieRun {
  std::string mission;
  std::string lie;  // "none" for the mission as it is.
  AgentId liar = 0;
  bool is_warm = false;  // True if the solve continued from the solution without the lie.
  // Move of the other rover that moved most, compared with the solution without the lie: median and largest over its
  // nodes.
  double median_move_m = 0;
  double largest_move_m = 0;
  std::size_t rejected_count = 0;  // True factors that the solution without the lie accepts and this one rejects.
  bool is_named = false;           // True if a refused set is of the liar, or lies between it and another agent.
  std::size_t named_others = 0;    // Other refused sets.
  double seconds = 0;
};

// Runs each lie whose name contains `only` with each rover as the liar, from odometry and from the solution without the
// lie. The first entry is the mission without a lie.
std::vector<LieRun> RunLies(const std::string& name, const Mission& mission, const SolverOptions& options,
                            const std::string& only);

}  // namespace moondb
