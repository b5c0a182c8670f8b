// Answers the completion scripts of shells (apps/moonctl/completion.h).
#pragma once

#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

inline constexpr char kCompleteWord[] = "__complete";  // As the first word: the rest is to be completed.

ExitCode PrintCompletions(const Command& root, const std::vector<std::string>& words, CommandContext& context);

}  // namespace moondb
