// `moondb_replay feed`: inserts a mission's records at the agents of a running team. Each agent gets the records of its
// own robot.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct FeedArguments {
  std::string mission;
  std::string team;
  std::optional<double> from_s;     // Start, in mission seconds. Empty: from the first record.
  std::optional<double> to_s;       // End (exclusive), in mission seconds. Empty: to the last record.
  std::vector<std::string> agents;  // Names of the agents. Empty: all agents.
  std::optional<double> speed;      // Mission seconds a second; see FeedInTime. Empty: all records at once.
};

// Runs the command. Skips records that the agents already hold, so an interrupted feed can be repeated. Prints progress
// on stderr and one line per agent on stdout.
Result<void> Feed(const FeedArguments& arguments);

}  // namespace moondb
