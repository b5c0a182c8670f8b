// The longer ones of `moonctl graph`: export, and the solver on a file by itself.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

void AddGraphExport(Command& group, CommandContext& context);
void AddGraphSolve(Command& group, CommandContext& context);

}  // namespace moondb
