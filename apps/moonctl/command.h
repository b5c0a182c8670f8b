// A command of moonctl: a Command with a note, whose callback sets the action to run. A group of commands ("role") that
// does nothing by itself has no note.
#pragma once

#include <string>

#include "apps/common/arguments.h"

namespace moondb {

inline constexpr bool kShows = true;

// Its --help ends with the example.
Command& AddCommand(Command& group, const std::string& name, const std::string& description, CommandNote note);

// A group has the note of its first command. Null: the command has none.
const CommandNote* NoteOf(const Command& command);

// Ends the --help of each group below `root` with the example of its first command.
void AddExamplesOfGroups(Command& root);

}  // namespace moondb
