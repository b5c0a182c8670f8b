// sync pause, sync resume: an operator's own window: nothing bulky is shared with an agent, or with any, for a while.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// As in apps/moonctl/commands.h; `sync` is the group that they belong to.
void AddPauseCommands(Command& sync, CommandContext& context);

}  // namespace moondb
