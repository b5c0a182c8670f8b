// Fourth part of pgo_bench. Draws loop closures and priors of a mission from its true poses, some of them wrong, and
// solves the mission with them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "apps/picture/tracks.h"
#include "model/mission.h"

namespace moondb {

struct ClosureRun {
  std::string mission;
  std::string what;  // The measurements: "none", "right", "60 % wrong", "a set shifted by 0.70 m", ...
  bool has_ranges = true;
  std::size_t closure_count = 0;
  std::size_t rejected_count = 0;
  std::size_t refused_set_count = 0;
  double ate_m = 0;
  double seconds = 0;
};

// Loop closures join nodes that are at most 3 m apart and belong to two rovers, or lie at least 10 nodes apart on one;
// each node has at most three. Their sigmas are 8 cm and 0.01 rad. A wrong one is off by up to 3 m and 0.5 rad. A
// shifted set has all loop closures between the first two rovers off by the same vector.
std::vector<ClosureRun> RunClosures(const std::string& name, const Mission& mission, const SolverOptions& options);

// Returns the tracks of a picture of one solve with ranges, loop closures and priors, half of the latter two wrong:
// the solved tracks, and each factor as a line or a square.
std::vector<Track> FactorTracks(const Mission& mission, const SolverOptions& options);

}  // namespace moondb
