// `moondb_replay score`: reads back what an agent holds, scores it against the mission's truth, writes pictures.
#pragma once

#include <string>

#include "model/error.h"

namespace moondb {

struct ScoreArguments {
  std::string mission;
  std::string team;
  std::string agent;
  std::string out;   // Folder for the pictures; made if it is missing.
  std::string json;  // File for the figures; empty: none.
};

// Pictures: merged_before.png, merged_after.png, merged_truth.png, before_after.png, one per rover (rover1.png),
// trajectories.png. Figures as a table on stdout.
Result<void> ScoreAgent(const ScoreArguments& arguments);

}  // namespace moondb
