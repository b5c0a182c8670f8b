// Second part of pgo_bench: a simulated lunar team (tests/actors/pgo/scenario.h), for several seeds and team sizes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "bench/pgo_methods.h"

namespace moondb {

// Parameters of a randomly generated team.
struct TeamCase {
  std::string name;
  int node_count = 2001;  // Nodes of the whole team.
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
  // Precision and recall with which Method::kStaged rejects outlier ranges, over all seeds.
  double precision = 0;
  double recall = 0;
  MethodFigures warm;    // Method::kStaged, started from the previous solution after 10 new nodes per rover.
  MethodFigures window;  // As `warm`, but only the last 100 nodes of each rover are variable.
};

std::vector<TeamCase> StandardTeamCases();

// Results of solves for teams of three rovers and a base station. Two of the rovers do not know their start poses.
struct UnknownStartsRun {
  int runs = 0;
  int right = 0;            // Runs with an error of the whole team below 1 m.
  int wrong_ambiguous = 0;  // Wrong runs (error of 1 m or more) that the solver reported as ambiguous.
  int right_ambiguous = 0;  // Right runs that the solver reported as ambiguous.
  double median_seconds = 0;
};

UnknownStartsRun RunUnknownStarts(int runs, const SolverOptions& options);

// Runs the case once per seed, from 1 to `seeds`.
TeamRun RunTeam(const TeamCase& team, int seeds, const SolverOptions& options);

}  // namespace moondb
