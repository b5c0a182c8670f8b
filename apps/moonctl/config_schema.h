// The JSON Schema (draft 7) of team files, for editors that complete and check YAML. Generated from proto::TeamConfig
// and its field rules. Covers names, types, ranges and choices. Relations between fields are checked only by `moonctl
// config check`. Thread-safe.
#pragma once

#include <string>

namespace moondb {

std::string TeamFileSchema();

}  // namespace moondb
