// --watch: repeats a command that changes nothing.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// Runs the chosen command every context.watch seconds until SIGINT or SIGTERM ends the process, or until stdout accepts
// no more output. Clears a terminal before each run. Other outputs get one block per run, or with --json one document
// per line. Returns the exit code of the last complete run, or 0 if there is none. Returns kUsage if the command
// changes something, if context.watch is less than 0.1 s or no duration, or if a run finds an error in the command line
// or the team file.
ExitCode RunWatched(const Command& root, CommandContext& context);

}  // namespace moondb
