// The whole command line of moonctl.
#pragma once

#include "apps/moonctl/command_context.h"

namespace CLI {
class App;
}

namespace moondb {

inline constexpr char kProgramName[] = "moonctl";
inline constexpr char kProgramDescription[] = "Operates a team of moondb agents.";

// Global options, all commands and their examples. `context` outlives the app.
void AddCommandLine(CLI::App& app, CommandContext& context);

}  // namespace moondb
