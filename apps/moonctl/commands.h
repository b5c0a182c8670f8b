// Functions that add the command groups to the command line. The chosen command stores its action in context.action,
// and main runs that action after parsing. Requires: `context` outlives `app`.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

void AddUpCommands(Command& app, CommandContext& context);
void AddStatusCommand(Command& app, CommandContext& context);
void AddHealthCommand(Command& app, CommandContext& context);
void AddRiskCommand(Command& app, CommandContext& context);
void AddRoleCommands(Command& app, CommandContext& context);
void AddShareCommands(Command& app, CommandContext& context);
void AddLeaseCommands(Command& app, CommandContext& context);
void AddClientsCommands(Command& app, CommandContext& context);
void AddKeysCommands(Command& app, CommandContext& context);
void AddGraphCommands(Command& app, CommandContext& context);
void AddMapCommands(Command& app, CommandContext& context);
void AddRecordCommands(Command& app, CommandContext& context);
void AddDbCommands(Command& app, CommandContext& context);
void AddDownlinkCommands(Command& app, CommandContext& context);
void AddExportCommands(Command& app, CommandContext& context);
void AddLogCommand(Command& app, CommandContext& context);
void AddTraceCommand(Command& app, CommandContext& context);
void AddViewCommand(Command& app, CommandContext& context);
void AddDoctorCommand(Command& app, CommandContext& context);
void AddConfigCommands(Command& app, CommandContext& context);
// Adds config pack, config unpack and config add-agent to the group config.
void AddPackCommands(Command& group, CommandContext& context);
void AddCompletionCommand(Command& app, CommandContext& context);

}  // namespace moondb
