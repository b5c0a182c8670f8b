// pgo_bench's second part: a simulated lunar team (tests/actors/pgo/scenario.h), over seeds and sizes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "bench/pgo_methods.h"

namespace moondb {

// What a team is drawn from.
struct TeamCase {
  std::string name;
  int node_count = 2001;  // Of the team.
  bool has_low_drift = false;
  double outlier_ratio = 0.05;
  double bias_sigma_m = 0;
  double correlation = 0;
  double outlier_min_m = 0.5;
};

struct TeamRun {
  TeamCase team;
  int seeds = 0;
  std::map<Method, MethodFigures> methods;
  double precision = 0;  // Of the rejection of ranges by the staged solve, over all seeds.
  double recall = 0;
  MethodFigures warm;    // The staged solve from the last solution, 10 new nodes per rover;
  MethodFigures window;  // of these the last 100 nodes per rover only.
};

std::vector<TeamCase> StandardTeamCases();

// Teams of three rovers and a base station, two of which do not know where they began.
struct UnknownStartsRun {
  int runs = 0;
  int right = 0;            // Error of the whole team below 1 m.
  int wrong_ambiguous = 0;  // Wrong, and reported as ambiguous.
  int right_ambiguous = 0;  // Right, and reported as ambiguous nevertheless.
  double median_seconds = 0;
};

UnknownStartsRun RunUnknownStarts(int runs, const SolverOptions& options);

// Seeds 1 to `seeds`.
TeamRun RunTeam(const TeamCase& team, int seeds, const SolverOptions& options);

}  // namespace moondb
