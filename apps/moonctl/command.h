// A command of moonctl: a CLI::App with what is said of it beyond its own line, and what it does. A group of commands
// ("role") that does nothing by itself is a plain CLI::App.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace moondb {

struct CommandNote {
  std::string example;      // As typed: "moonctl role set rover2 leader".
  bool is_showing = false;  // Changes nothing, so that it can be repeated: --watch.
};
inline constexpr bool kShows = true;

// Its --help ends with the example.
CLI::App& AddCommand(CLI::App& group, const std::string& name, const std::string& description, CommandNote note);

// A group has the note of its first command. Null: the command has none.
const CommandNote* NoteOf(const CLI::App& command);

// Ends the --help of each group below `root` with the example of its first command.
void AddExamplesOfGroups(CLI::App& root);

}  // namespace moondb
