// Fifth part of pgo_bench. Matches the local maps of a mission in two passes, as RegisterActor does, and solves the
// mission with the matches.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/mission.h"

namespace moondb {

struct RegistrationRun {
  std::string mission;
  std::string what;  // The stage: "no matches", "first pass", "second pass", "60 % wrong", ...
  bool has_ranges = true;
  std::size_t candidate_count = 0;  // Pairs matched in this pass.
  std::map<std::string, std::size_t> verdicts;
  std::size_t match_count = 0;  // Matches given to the solver.
  std::size_t used_count = 0;   // Matches that the solver accepted.
  std::size_t right_count = 0;  // Used matches within 0.2 m and 2 degrees of the truth.
  std::size_t refused_set_count = 0;
  double worst_used_m = 0;  // Largest error of a used match.
  double median_ms = 0;     // Per pair, in CPU time, without the fields of the maps.
  double seconds = 0;       // CPU time of the pass, fields included.
  double ate_m = 0;
  std::optional<double> hazard_iou;
};

// Runs a mission with and without its ranges: without matches, with two passes, and with wrong matches.
std::vector<RegistrationRun> RunRegistration(const std::string& name, const Mission& mission,
                                             const SolverOptions& options);

// Errors of a mission without and with matches.
struct RegistrationAte {
  double without_m = 0;
  double with_m = 0;
};

// Compares the mission's errors without and with two passes of matches.
RegistrationAte CompareRegistration(const Mission& mission, const SolverOptions& options);

}  // namespace moondb
