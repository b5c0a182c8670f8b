// What a team's configuration may say, and what it means where it says nothing. Used by runtime/team_config.cc.
#pragma once

#include <string>

#include "proto/team.pb.h"
#include "runtime/yaml_reader.h"

namespace moondb {

inline constexpr int kAgentCountMax = 64;
inline constexpr int kCustomTypeCountMax = 64;

// At most 32 lower-case letters, digits, - and _.
bool IsPlainName(const std::string& name);
inline constexpr char kPlainNameRule[] = "expected at most 32 lower-case letters, digits, - and _, got ";

// Adds to `errors` every range, name, address, role, custom type or duplicate that cannot be.
void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors);

// Fills in each default that team.proto leaves open; `places` tells what the file gives. The team is checked.
//
// Policies of `share`: states latest, nodes and edges all, optimized poses and verdicts latest, maps all.
// Policies of `ground`: states latest, nodes all, optimized poses latest, the rest none.
// Policies of `keep`: states all, optimized poses and verdicts latest; 64 MB of history.
// Custom types: share all, ground none, priority 5, payloads of at most 4096 bytes, keep all; sorted by id, since their
// order means nothing. Leader: the first rover; survivor: the next one. Leader's timeout 120 s, budget 1000 kbps, quiet
// while driving, cells of 0.05 m, a footprint of 0.75 m by 0.5 m, antennas at 0, start poses known to 0.05 m and 0.01
// rad.
void FillDefaults(const Places& places, proto::TeamConfig* team);

}  // namespace moondb
