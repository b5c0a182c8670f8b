// Estimates the radio time that the policy `rovers` takes. Thread-safe.
#pragma once

#include <string>

#include "proto/team.pb.h"

namespace moondb {

// Above this part of radio.budget_kbps, `config check` warns.
inline constexpr double kTeamMapPartMax = 0.05;

// Returns the part of the leader's radio time that the records of `rovers` take; 0 without such policies. Assumes a
// node and a local map each 10 s, 12 solves an hour, and the sizes of the recorded mission intel_team (docs/SIZING.md).
double TeamMapPart(const proto::TeamConfig& team);

// Returns a line of `config check`; empty without such policies.
std::string TeamMapText(const proto::TeamConfig& team);

}  // namespace moondb
