// `sync pause` stops bulk transfers with one agent or all agents for a limited time. `sync resume` ends a pause.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// Adds the commands to the group `sync`. Requires: `context` outlives `sync`.
void AddPauseCommands(Command& sync, CommandContext& context);

}  // namespace moondb
