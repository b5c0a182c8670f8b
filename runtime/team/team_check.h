// Checks a team's configuration and sets its defaults. Used by runtime/team/team_config.cc.
#pragma once

#include <string>

#include "proto/team.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

inline constexpr int kAgentCountMax = 64;

// Returns true if `name` consists of 1 to 32 lower-case letters, digits, - and _.
bool IsPlainName(const std::string& name);
inline constexpr char kPlainNameRule[] = "expected at most 32 lower-case letters, digits, - and _, got ";

// Adds an error to `errors` for each invalid range, name, address, role or custom type, and for each duplicate. Ranges
// of single fields are defined in proto/team.proto.
void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors);

// Sets the missing fields of a team that passed CheckTeam. `places` contains the fields that are in the file.
//
// Defaults of single fields are defined in proto/team.proto, and policies of built-in types in model/data_types.h.
// `keep` gets a rule for each type whose built-in sharing policy is `latest`: the rule is `latest` for optimized poses
// and edge verdicts if the team shares them under `latest`, otherwise `all`. The first rover becomes the leader, and
// the next one the designated survivor. Sorts custom types by id, because their order has no meaning.
void FillDefaults(const Places& places, proto::TeamConfig* team);

}  // namespace moondb
