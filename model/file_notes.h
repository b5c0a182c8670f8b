// Where a file came from, in words that travel inside of it: "agent" "rover1", "maps" "183".
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace moondb {

// Keys and texts are one line of ASCII each, a key at most 79 characters and without a colon.
using FileNotes = std::vector<std::pair<std::string, std::string>>;

// "agent: rover1\n...", each line after `prefix`.
inline std::string NotesText(const FileNotes& notes, const std::string& prefix = "") {
  std::string text;
  for (const auto& [key, value] : notes) text += prefix + key + ": " + value + "\n";
  return text;
}

}  // namespace moondb
