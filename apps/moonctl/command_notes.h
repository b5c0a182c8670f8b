// What is said of each command beyond its own line: a real example, which --help ends with, and whether it only shows
// something. One table for all, so that nobody forgets it: a test demands an entry of every command.
#pragma once

#include <string_view>

namespace CLI {
class App;
}

namespace moondb {

struct CommandNote {
  std::string_view path;     // "role set".
  std::string_view example;  // As typed: "moonctl role set rover2 leader".
  bool is_showing = false;   // Changes nothing, so that it can be repeated: --watch.
};

// Null for a command that has none. A group of commands has that of its first one.
const CommandNote* NoteOf(const CLI::App& command);

// Ends the --help of `command` and of all below it with their examples.
void AddExamples(CLI::App& command);

}  // namespace moondb
