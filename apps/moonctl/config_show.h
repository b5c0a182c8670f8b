// A team's configuration in full, as its agents have it: what the team file says and what it leaves to its default.
// Plain functions.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "model/error.h"
#include "proto/team.pb.h"

namespace moondb {

// The fields that the file gives, by path ("agents[0].id"), numbered as in the configuration made from it.
std::set<std::string> GivenFields(const std::string& yaml);

// The configuration as YAML of the team file's own form; what is not `given` ends with "# default". Read again, it
// means the same.
std::string EffectiveYaml(const proto::TeamConfig& team, const std::set<std::string>& given);

// The paths of the values that are not given.
std::vector<std::string> DefaultedFields(const proto::TeamConfig& team, const std::set<std::string>& given);

}  // namespace moondb
