// The longer ones of `moonctl graph`: export, and the solver on a file by itself.
#pragma once

#include "apps/moonctl/command_context.h"

namespace CLI {
class App;
}

namespace moondb {

void AddGraphExport(CLI::App& group, CommandContext& context);
void AddGraphSolve(CLI::App& group, CommandContext& context);

}  // namespace moondb
