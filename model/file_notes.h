// Metadata about the origin of a file, stored inside the file as pairs of key and text: "agent" "rover1", "maps" "183".
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace moondb {

// Pairs of key and text, each one line of ASCII. A key has at most 79 characters and no colon.
using FileNotes = std::vector<std::pair<std::string, std::string>>;

// Returns "agent: rover1\n...", with `prefix` before each line.
inline std::string NotesText(const FileNotes& notes, const std::string& prefix = "") {
  std::string text;
  for (const auto& [key, value] : notes) text += prefix + key + ": " + value + "\n";
  return text;
}

}  // namespace moondb
