// The longer commands of `moonctl graph`: `export`; `import`; `matches`, which shows matches of local maps; and
// `solve`, which solves a graph file without a team.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

void AddGraphExport(Command& group, CommandContext& context);
void AddGraphImport(Command& group, CommandContext& context);
void AddGraphMatches(Command& group, CommandContext& context);
void AddGraphSolve(Command& group, CommandContext& context);

}  // namespace moondb
