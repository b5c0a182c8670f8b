// The JSON Schema (draft 7) of team files, for editors that complete and check YAML by one. Made by reflection over
// proto::TeamConfig and the rules of its fields; it knows names, types, ranges and choices, but not what fields say of
// each other: the judge is `moonctl config check`. Pure function.
#pragma once

#include <string>

namespace moondb {

std::string TeamFileSchema();

}  // namespace moondb
