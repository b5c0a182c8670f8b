// The command groups: each adds its subcommands to the command line. The chosen one puts itself into context.action,
// which main runs after parsing. `context` outlives the app.
#pragma once

#include "apps/moonctl/command_context.h"

namespace CLI {
class App;
}

namespace moondb {

void AddUpCommands(CLI::App& app, CommandContext& context);
void AddStatusCommand(CLI::App& app, CommandContext& context);
void AddHealthCommand(CLI::App& app, CommandContext& context);
void AddRoleCommands(CLI::App& app, CommandContext& context);
void AddShareCommands(CLI::App& app, CommandContext& context);
void AddLeaseCommands(CLI::App& app, CommandContext& context);
void AddClientsCommands(CLI::App& app, CommandContext& context);
void AddKeysCommands(CLI::App& app, CommandContext& context);
void AddGraphCommands(CLI::App& app, CommandContext& context);
void AddMapCommands(CLI::App& app, CommandContext& context);
void AddRecordCommands(CLI::App& app, CommandContext& context);
void AddDbCommands(CLI::App& app, CommandContext& context);
void AddDownlinkCommands(CLI::App& app, CommandContext& context);
void AddLogCommand(CLI::App& app, CommandContext& context);
void AddTraceCommand(CLI::App& app, CommandContext& context);
void AddConfigCommands(CLI::App& app, CommandContext& context);
void AddCompletionCommand(CLI::App& app, CommandContext& context);

}  // namespace moondb
