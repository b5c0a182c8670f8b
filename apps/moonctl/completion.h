// Suggests words for the end of a command line, for shell completion. The scripts printed by `moonctl completion` call
// `moonctl __complete WORD...` at each press of the completion key, so the suggestions always match the commands and
// the team. Plain functions.
#pragma once

#include <string>
#include <vector>

namespace moondb {

class Command;

// Words from the team file. Empty if no team file can be read.
struct TeamWords {
  std::vector<std::string> agents;
  std::vector<std::string> data_types;
};

struct Candidate {
  std::string word;
  std::string description;
};

struct Completion {
  std::vector<Candidate> candidates;  // Candidates that begin with the last word.
  bool is_file = false;               // The last word may be a path, which the shell completes.
};

// Returns the candidates for the last of `words`, which follow "moonctl" on the command line. The user is typing the
// last word, which may be empty. A separate word "=", which bash makes of "--agent=rover1", is ignored.
Completion Complete(const Command& root, const std::vector<std::string>& words, const TeamWords& team);

}  // namespace moondb
