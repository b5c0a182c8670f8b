// First part of pgo_bench: solves the graph files of a folder with the solver and by least squares from odometry, for
// comparison.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "apps/picture/tracks.h"
#include "model/error.h"
#include "model/mission.h"

namespace moondb {

// Result of solving one graph with one method.
struct GraphResult {
  bool has_converged = false;
  double cost = 0;  // F of actors/pgo/standalone_graph.h for a graph file; Solution::final_cost for a team.
  // Absolute trajectory error: root mean square of the distances from the ground truth. Null for a .g2o file, which has
  // no ground truth. The solution of a .pyfg file is first rigidly aligned with the ground truth.
  std::optional<double> ate_m;
  double seconds = 0;
  // For a team: intersection over union of the hazard cells of two merged maps, one with the maps at the solved poses
  // and one with the maps at the true poses. Null if there are no maps or they cannot be merged, for example because a
  // map's node was not solved.
  std::optional<double> hazard_iou;
};

struct GraphRun {
  std::string name;  // Name of the file without its extension, or of a team's folder.
  bool is_team = false;
  std::size_t node_count = 0;
  std::size_t edge_count = 0;
  std::size_t range_count = 0;
  GraphResult ours;
  std::string initialisation;
  std::string text;                  // Describes quantities that could not be determined.
  std::optional<GraphResult> plain;  // Result of least squares with Ceres, started from odometry.
  std::vector<Track> odometry_tracks;
  std::vector<Track> tracks;
  std::vector<Track> true_tracks;
};

struct GraphBenchOptions {
  SolverOptions solver;   // Options for teams. For standalone graphs, only thread_count is used.
  bool has_plain = true;  // True to solve by least squares from odometry as well.
};

// Returns the .g2o and .pyfg files in `folder`, sorted by name, and the team missions. A team mission is `folder`
// itself or a folder in it that contains agents.csv.
std::vector<std::filesystem::path> FindGraphs(const std::filesystem::path& folder);

// Compares two merged maps of a mission's local maps, one at `poses` and one at the true poses: intersection over union
// of their hazard cells. Null as in GraphResult.
std::optional<double> HazardIou(const Mission& mission, const std::map<NodeKey, Pose>& poses);

// Solves one graph file or team mission. Errors are those of the file readers.
Result<GraphRun> RunGraph(const std::filesystem::path& path, const GraphBenchOptions& options);

}  // namespace moondb
