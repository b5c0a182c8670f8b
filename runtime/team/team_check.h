// What a team's configuration may say, and what it means where it says nothing. Used by runtime/team/team_config.cc.
#pragma once

#include <string>

#include "proto/team.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

inline constexpr int kAgentCountMax = 64;

// At most 32 lower-case letters, digits, - and _.
bool IsPlainName(const std::string& name);
inline constexpr char kPlainNameRule[] = "expected at most 32 lower-case letters, digits, - and _, got ";

// Adds to `errors` every range, name, address, role, custom type or duplicate that cannot be. Ranges of single keys are
// those of proto/team.proto.
void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors);

// Fills in what is left open; `places` says what the file gives. The team is checked.
//
// Defaults of single keys are those of proto/team.proto, policies of built-in types those of model/data_types.h. Of the
// types that are shared as `latest` by default `keep` is all, but latest for optimized poses and verdicts. Leader: the
// first rover; survivor: the next one. Custom types are sorted by id, since their order means nothing.
void FillDefaults(const Places& places, proto::TeamConfig* team);

}  // namespace moondb
