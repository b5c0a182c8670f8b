#include "apps/moonctl/command.h"

#include <utility>

#include "model/text.h"

namespace moondb {
namespace {

std::string FooterOf(const CommandNote& note) {
  std::string text;
  for (const std::string_view example : Split(note.example, '\n')) {
    text += (text.empty() ? "Example: " : "\nExample: ") + std::string(example);
  }
  return text;
}

}  // namespace

Command& AddCommand(Command& group, const std::string& name, const std::string& description, CommandNote note) {
  Command& command = group.AddSubcommand(name, description).Footer(FooterOf(note));
  return command.SetNote(std::move(note));
}

const CommandNote* NoteOf(const Command& command) {
  if (command.note() != nullptr) return command.note();
  const auto subcommands = command.subcommands();
  return subcommands.empty() ? nullptr : NoteOf(*subcommands.front());
}

void AddExamplesOfGroups(Command& root) {
  for (Command* sub : root.subcommands()) {
    if (const CommandNote* note = NoteOf(*sub)) sub->Footer(FooterOf(*note));
    AddExamplesOfGroups(*sub);
  }
}

}  // namespace moondb
