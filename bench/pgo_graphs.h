// pgo_bench's first part: graphs in a folder, solved as they are written, against plain least squares from odometry.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/error.h"
#include "model/map_picture.h"

namespace moondb {

// How one way to solve a graph ended.
struct GraphResult {
  bool has_converged = false;
  double cost = 0;  // F of actors/pgo/standalone_graph.h; of a team the solver's own F over accepted ranges.
  std::optional<double>
      ate_m;  // Where the file has the truth: PyFG's vertices. Aligned rigidly for graphs without map.
  double seconds = 0;
  // Of a team: its maps merged at these poses, against those merged at the truth. None without maps, and where a map's
  // node was not solved.
  std::optional<double> hazard_iou;
};

struct GraphRun {
  std::string name;  // Of the file without its ending; of a team's folder its own.
  bool is_team = false;
  std::size_t node_count = 0;
  std::size_t edge_count = 0;
  std::size_t range_count = 0;
  GraphResult ours;
  std::string initialisation;
  std::string text;                  // What could not be determined.
  std::optional<GraphResult> plain;  // Least squares with Ceres from odometry.
  std::vector<Track> odometry_tracks;
  std::vector<Track> tracks;
  std::vector<Track> true_tracks;
};

struct GraphBenchOptions {
  SolverOptions solver;   // Of teams; its threads are everybody's.
  bool has_plain = true;  // Also solve plainly from odometry.
};

// Files .g2o and .pyfg in `folder`, by name, and folders in it (or itself) that hold agents.csv: these as team
// missions.
std::vector<std::filesystem::path> FindGraphs(const std::filesystem::path& folder);

// The readers' errors.
Result<GraphRun> RunGraph(const std::filesystem::path& path, const GraphBenchOptions& options);

}  // namespace moondb
