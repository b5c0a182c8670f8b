#include "apps/moonctl/command_line.h"

#include <CLI/CLI.hpp>

#include "apps/common/json_writer.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/manual_page.h"

namespace moondb {
namespace {

void AddVersionCommand(CLI::App& app, CommandContext& context) {
  AddCommand(app, "version", "Show the version", {"moonctl version --json"}).callback([&context] {
    context.action = [&context] {
      JsonWriter json;
      json.BeginObject().Key("version").String(MOONDB_VERSION).EndObject();
      return context.Done(json.text(), "moonctl " MOONDB_VERSION);
    };
  });
}

void AddManCommand(CLI::App& app, CommandContext& context) {
  AddCommand(app, "man", "Print the manual page, moonctl.1", {"moonctl man > moonctl.1"}).callback([&app, &context] {
    context.action = [&app, &context] {
      const std::string page = ManualPage(app, MOONDB_VERSION);
      JsonWriter json;
      json.BeginObject().Key("roff").String(page).EndObject();
      return context.Done(json.text(), page);
    };
  });
}

}  // namespace

void AddCommandLine(CLI::App& app, CommandContext& context) {
  app.require_subcommand(1);
  app.fallthrough();  // Global options may stand behind the command.
  app.add_option("-t,--team", context.team_path, "Team file (default: $MOONDB_TEAM)")->type_name("FILE");
  app.add_option("-a,--agent", context.agent, "Ask this agent")->type_name("AGENT");
  app.add_flag("--json", context.is_json, "One JSON document on stdout");
  app.add_option(
         "--via", context.via,
         "Ask all agents through this one, over the radio (default: $MOONDB_VIA; without one agents that are not on "
         "this machine are asked through one that is)")
      ->type_name("AGENT");
  app.add_option(
         "--key", context.key_file,
         "Secret key to be let in by, at agents' client_address (default: $MOONDB_CLIENT_KEY; without one agents "
         "are reached on this machine alone)")
      ->type_name("FILE");
  app.add_option("--timeout", context.timeout, "Longest wait for an answer: 3s, 500ms, 2m")->type_name("DURATION");
  app.add_flag("--watch{2}", context.watch,
               "Again every 2 s (--watch=10: every 10 s); for commands that show something");
  app.set_version_flag("--version", "moonctl " MOONDB_VERSION);
  AddUpCommands(app, context);
  AddStatusCommand(app, context);
  AddHealthCommand(app, context);
  AddRoleCommands(app, context);
  AddShareCommands(app, context);
  AddLeaseCommands(app, context);
  AddClientsCommands(app, context);
  AddKeysCommands(app, context);
  AddGraphCommands(app, context);
  AddMapCommands(app, context);
  AddRecordCommands(app, context);
  AddDbCommands(app, context);
  AddDownlinkCommands(app, context);
  AddLogCommand(app, context);
  AddTraceCommand(app, context);
  AddConfigCommands(app, context);
  AddCompletionCommand(app, context);
  AddManCommand(app, context);
  AddVersionCommand(app, context);
  app.footer("Example: moonctl -t team.yaml status");
  AddExamplesOfGroups(app);
}

}  // namespace moondb
