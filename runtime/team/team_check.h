// Checks a team's configuration and fills in its defaults. Used by runtime/team/team_config.cc.
#pragma once

#include <string>

#include "proto/team.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

inline constexpr int kAgentCountMax = 64;

// True if `name` is 1 to 32 lower-case letters, digits, - and _.
bool IsPlainName(const std::string& name);
inline constexpr char kPlainNameRule[] = "expected at most 32 lower-case letters, digits, - and _, got ";

// Adds to `errors` every invalid range, name, address, role or custom type, and every duplicate. Ranges of single
// fields are defined in proto/team.proto.
void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors);

// Sets the missing fields of a team that passed CheckTeam. `places` holds the fields that the file gives.
//
// Defaults of single fields are defined in proto/team.proto, policies of built-in types in model/data_types.h. For
// types whose default policy is `latest`, `keep` is `latest` for optimized poses and verdicts and `all` for the rest.
// The first rover is the leader, the next one the designated survivor. Custom types are sorted by id, because their
// order has no meaning.
void FillDefaults(const Places& places, proto::TeamConfig* team);

}  // namespace moondb
