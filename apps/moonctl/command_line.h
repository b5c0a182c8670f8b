// Builds the whole command line of moonctl.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

inline constexpr char kProgramName[] = "moonctl";
inline constexpr char kProgramDescription[] = "Operates a team of moondb agents.";

// Adds the global options, all commands and the commands' examples to `app`. Requires: `context` outlives `app`.
void AddCommandLine(Command& app, CommandContext& context);

}  // namespace moondb
