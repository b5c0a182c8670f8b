// What could stand at the end of a command line, for the completion of shells. The scripts that `moonctl completion`
// prints ask `moonctl __complete WORD...` at each press of the key, so that they never lag behind the commands or the
// team. Plain functions.
#pragma once

#include <string>
#include <vector>

namespace moondb {

class Command;

// Words that only the team file knows; without one none.
struct TeamWords {
  std::vector<std::string> agents;
  std::vector<std::string> data_types;
};

struct Candidate {
  std::string word;
  std::string description;
};

struct Completion {
  std::vector<Candidate> candidates;  // Those that begin as the last word does.
  bool is_file = false;               // A path is expected; shells know better.
};

// `words` are those behind "moonctl"; the last one, which may be empty, is being typed. "=" as a word of its own, as
// bash cuts "--agent=rover1", counts for nothing.
Completion Complete(const Command& root, const std::vector<std::string>& words, const TeamWords& team);

}  // namespace moondb
