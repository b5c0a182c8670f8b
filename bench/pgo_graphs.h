// First part of pgo_bench: solves graph files of a folder, and compares the solver with least squares from odometry.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/error.h"
#include "model/map_picture.h"

namespace moondb {

// Result of solving one graph with one method.
struct GraphResult {
  bool has_converged = false;
  double cost = 0;  // F of actors/pgo/standalone_graph.h; for a team, the solver's F over accepted ranges.
  std::optional<double>
      ate_m;  // Null if the file has no ground truth (PyFG vertices). Rigidly aligned for graphs without map.
  double seconds = 0;
  // For a team: intersection over union of hazards in the maps merged at these poses and at the true poses. Null
  // without maps, or if the node of a map was not solved.
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
  std::string text;                  // Description of quantities that could not be determined.
  std::optional<GraphResult> plain;  // Least squares with Ceres from odometry.
  std::vector<Track> odometry_tracks;
  std::vector<Track> tracks;
  std::vector<Track> true_tracks;
};

struct GraphBenchOptions {
  SolverOptions solver;   // Options for teams. Other methods use its thread count, too.
  bool has_plain = true;  // Also solve by least squares from odometry.
};

// Returns the .g2o and .pyfg files in `folder`, sorted by name, and the team missions: folders in it (or itself) that
// contain agents.csv.
std::vector<std::filesystem::path> FindGraphs(const std::filesystem::path& folder);

// Errors: those of the file readers.
Result<GraphRun> RunGraph(const std::filesystem::path& path, const GraphBenchOptions& options);

}  // namespace moondb
