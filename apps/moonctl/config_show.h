// A team's complete configuration as its agents use it: the values of the team file and the defaults of all other
// fields. Thread-safe.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "model/error.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the paths ("agents[0].id") of the fields that the team file `yaml` sets. Indices are those of the parsed
// configuration, in which custom types are sorted by id.
std::set<std::string> GivenFields(const std::string& yaml);

// Returns the configuration as YAML in the form of a team file. Appends "# default" to values whose paths are not in
// `given`. Parsing this YAML gives the same configuration.
std::string EffectiveYaml(const proto::TeamConfig& team, const std::set<std::string>& given);

// Returns the paths of the fields that are not in `given`. The agents use the default values of these fields.
std::vector<std::string> DefaultedFields(const proto::TeamConfig& team, const std::set<std::string>& given);

}  // namespace moondb
