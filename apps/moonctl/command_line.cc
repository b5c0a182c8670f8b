#include "apps/moonctl/command_line.h"

#include "apps/common/json_writer.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/manual_page.h"
#include "apps/moonctl/mistyped.h"

namespace moondb {
namespace {

void AddVersionCommand(Command& app, CommandContext& context) {
  AddCommand(app, "version", "Show the version", {"moonctl version --json"}).Callback([&context] {
    context.action = [&context] {
      JsonWriter json;
      json.BeginObject().Key("version").String(MOONDB_VERSION).EndObject();
      return context.Done(json.text(), "moonctl " MOONDB_VERSION);
    };
  });
}

void AddManCommand(Command& app, CommandContext& context) {
  AddCommand(app, "man", "Print the manual page, moonctl.1", {"moonctl man > moonctl.1"}).Callback([&app, &context] {
    context.action = [&app, &context] {
      const std::string page = ManualPage(app, MOONDB_VERSION);
      JsonWriter json;
      json.BeginObject().Key("roff").String(page).EndObject();
      return context.Done(json.text(), page);
    };
  });
}

void AddHelpCommand(Command& app, CommandContext& context) {
  auto words = std::make_shared<std::vector<std::string>>();
  Command& help = AddCommand(app, "help", "Show the help of a command", {"moonctl help role set"});
  help.AddOption("command", *words, "The command, or a group of commands").TypeName("COMMAND").Expected(0, 3);
  help.Callback([&app, &context, words] {
    context.action = [&app, &context, words] {
      const Command* command = FindCommand(app, *words);
      if (command == nullptr) {
        return context.Report({ErrorCode::kInvalid, DescribeMistyped(app, *words).value_or("no such command"), {}});
      }
      JsonWriter json;
      json.BeginObject().Key("help").String(command->Help()).EndObject();
      return context.Done(json.text(), command->Help());
    };
  });
}

}  // namespace

void AddCommandLine(Command& app, CommandContext& context) {
  app.RequireSubcommand();
  app.Fallthrough();  // Global options may follow the command.
  app.AddOption("-t,--team", context.team_path, "Team file (default: $MOONDB_TEAM)").TypeName("FILE");
  app.AddOption("-a,--agent", context.agent, "Send the command to this agent").TypeName("AGENT");
  app.AddFlag("--json", context.is_json, "Print one JSON document to stdout");
  app.AddOption(
         "--via", context.via,
         "Relay requests to all agents through this one, over the radio (default: $MOONDB_VIA; without it requests to "
         "agents elsewhere are relayed by an agent on this machine)")
      .TypeName("AGENT");
  app.AddOption("--key", context.key_file,
                "Secret key for agents' client_address (default: $MOONDB_CLIENT_KEY; without a key only agents on "
                "this machine are reached)")
      .TypeName("FILE");
  app.AddOption("--timeout", context.timeout, "Time limit for an answer: 3s, 500ms, 2m").TypeName("DURATION");
  app.AddFlag("--watch{2}", context.watch,
              "Repeat the command every 2 s (--watch=10: every 10 s); only for commands that change nothing");
  app.AddVersionFlag("--version", "moonctl " MOONDB_VERSION);
  AddUpCommands(app, context);
  AddStatusCommand(app, context);
  AddHealthCommand(app, context);
  AddRiskCommand(app, context);
  AddDoctorCommand(app, context);
  AddViewCommand(app, context);
  AddRoleCommands(app, context);
  AddShareCommands(app, context);
  AddLeaseCommands(app, context);
  AddClientsCommands(app, context);
  AddKeysCommands(app, context);
  AddGraphCommands(app, context);
  AddMapCommands(app, context);
  AddExportCommands(app, context);
  AddRecordCommands(app, context);
  AddDbCommands(app, context);
  AddDownlinkCommands(app, context);
  AddLogCommand(app, context);
  AddTraceCommand(app, context);
  AddConfigCommands(app, context);
  AddCompletionCommand(app, context);
  AddManCommand(app, context);
  AddHelpCommand(app, context);
  AddVersionCommand(app, context);
  app.Footer("Example: moonctl -t team.yaml status");
  AddExamplesOfGroups(app);
}

}  // namespace moondb
