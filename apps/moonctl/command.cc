#include "apps/moonctl/command.h"

#include <memory>
#include <utility>

#include "apps/moonctl/command_tree.h"

namespace moondb {
namespace {

class Command final : public CLI::App {
 public:
  Command(const std::string& description, const std::string& name, CLI::App& group, CommandNote note)
      : CLI::App(description, name, &group), note_(std::move(note)) {}

  const CommandNote& note() const { return note_; }

 private:
  CommandNote note_;
};

std::string FooterOf(const CommandNote& note) { return "Example: " + note.example; }

}  // namespace

CLI::App& AddCommand(CLI::App& group, const std::string& name, const std::string& description, CommandNote note) {
  auto command = std::make_shared<Command>(description, name, group, std::move(note));
  command->footer(FooterOf(command->note()));
  return *group.add_subcommand(std::move(command));
}

const CommandNote* NoteOf(const CLI::App& command) {
  if (const auto* noted = dynamic_cast<const Command*>(&command)) return &noted->note();
  const auto subcommands = SubcommandsOf(command);
  return subcommands.empty() ? nullptr : NoteOf(*subcommands.front());
}

void AddExamplesOfGroups(CLI::App& root) {
  for (CLI::App* sub : root.get_subcommands([](CLI::App*) { return true; })) {
    if (const CommandNote* note = NoteOf(*sub)) sub->footer(FooterOf(*note));
    AddExamplesOfGroups(*sub);
  }
}

}  // namespace moondb
