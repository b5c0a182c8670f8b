// Adds commands to moonctl. A command has a CommandNote, and its callback stores the action that main runs. A group
// such as "role" only holds subcommands and has no note.
#pragma once

#include <string>

#include "apps/common/arguments.h"

namespace moondb {

inline constexpr bool kShows = true;

// Adds a command whose --help ends with the note's example.
Command& AddCommand(Command& group, const std::string& name, const std::string& description, CommandNote note);

// Returns the command's note, or for a group the note of its first command. Null: the command has no note.
const CommandNote* NoteOf(const Command& command);

// Ends the --help of every group below `root` with the example of the group's first command.
void AddExamplesOfGroups(Command& root);

}  // namespace moondb
