// Searches for the relative poses of rovers that started anywhere, by their maps alone, as
// RegisterActor does: within each mission, and across the missions, where no pair may be placed.
#pragma once

#include <string>
#include <vector>

#include "model/mission.h"

namespace moondb {

// The search for two rovers.
struct AnywhereRun {
  std::string rovers;  // "intel_team 1, intel_team 2"
  int draw = 0;        // 0: the recorded odometry.
  double part = 1;     // Part of the mission's time that was used.
  bool is_same_mission = false;
  std::string verdict;
  bool is_placed = false;
  bool is_wrong = false;  // Placed across missions, or off by more than 1 m or 5 degrees (median of the matches).
  double evidence = 0;
  double rival = 0;
  double matched = 0;
  double contradicted = 0;
  std::size_t match_count = 0;
  double error_m = 0;  // Median error of the matches.
  double error_deg = 0;
  double seconds = 0;      // CPU time.
  double step_max_ms = 0;  // CPU time of the longest step.
};

// `draws`: how often the odometry is drawn again, in addition to the recorded one.
std::vector<AnywhereRun> RunAnywhere(const std::vector<Mission>& missions, int draws);

std::string TextOf(const std::vector<AnywhereRun>& runs);
std::string JsonOf(const std::vector<AnywhereRun>& runs);

}  // namespace moondb
