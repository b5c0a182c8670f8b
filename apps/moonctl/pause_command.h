// `sync pause` and `sync resume`: an operator stops bulk transfers with one agent or all agents for a limited time.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// See apps/moonctl/commands.h. `sync` is the group that gets the commands.
void AddPauseCommands(Command& sync, CommandContext& context);

}  // namespace moondb
