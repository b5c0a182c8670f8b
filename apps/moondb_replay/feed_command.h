// `moondb_replay feed`: gives a mission's records to the agents of a running team, each its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct FeedArguments {
  std::string mission;
  std::string team;
  std::optional<double> from_s;     // Mission seconds; from the beginning.
  std::optional<double> to_s;       // Before this; to the end.
  std::vector<std::string> agents;  // Empty: all.
};

// What was stored by the agents is left out, so that a feed that broke off can be given again. Progress on stderr, one
// line per agent on stdout.
Result<void> Feed(const FeedArguments& arguments);

}  // namespace moondb
