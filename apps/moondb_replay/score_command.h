// `moondb_replay score`: reads an agent's records, scores them against the mission's truth and writes pictures.
#pragma once

#include <string>

#include "model/error.h"

namespace moondb {

struct ScoreArguments {
  std::string mission;
  std::string team;
  std::string agent;
  std::string out;          // Folder for the pictures. Created if missing.
  std::string json;         // File for the scores. Empty: none.
  bool is_aligned = false;  // True: moves the team to where it fits the truth best, for teams without starts.
};

// Writes the pictures merged_before.png, merged_after.png, merged_truth.png, before_after.png, trajectories.png and one
// per rover (rover1.png). Prints the scores as a table on stdout.
Result<void> ScoreAgent(const ScoreArguments& arguments);

}  // namespace moondb
