// --watch: a command that shows something, again and again.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// Runs the chosen command every context.watch seconds until SIGINT or SIGTERM ends the process with the last pass'
// exit code (0 before the first has ended), or until stdout takes no more. A terminal is drawn anew, elsewhere one
// block follows the other, with --json one document a line. kUsage: a command that changes something, no duration, or
// a pass that found the command line or the team file wrong, which time does not mend.
ExitCode RunWatched(const Command& root, CommandContext& context);

}  // namespace moondb
