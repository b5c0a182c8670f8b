// Suggests words for the end of a command line, for shell completion. The scripts printed by `moonctl completion` call
// `moonctl __complete WORD...` at each press of the completion key, so the suggestions always match the commands and
// the team.
#pragma once

#include <string>
#include <vector>

namespace moondb {

class Command;

// Words from the team file. If no team file can be read: no agents, and only the built-in data types.
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
  bool is_file = false;               // The last word may be a path. The shell then adds paths.
};

// Returns the candidates for the last of `words`, the words after "moonctl". The user is typing the last word, which
// may be empty. Ignores a separate word "=", because bash splits "--agent=rover1" into three words.
Completion Complete(const Command& root, const std::vector<std::string>& words, const TeamWords& team);

}  // namespace moondb
