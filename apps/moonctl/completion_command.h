// The commands that print completion scripts and answer these scripts' requests (apps/moonctl/completion.h).
#pragma once

#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

// First word of a completion script's request. The words to complete follow it.
inline constexpr char kCompleteWord[] = "__complete";

ExitCode PrintCompletions(const Command& root, const std::vector<std::string>& words, CommandContext& context);

}  // namespace moondb
