// Answers the shells' completion scripts (apps/moonctl/completion.h).
#pragma once

#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

inline constexpr char kCompleteWord[] = "__complete";  // First word of a request to complete the words after it.

ExitCode PrintCompletions(const Command& root, const std::vector<std::string>& words, CommandContext& context);

}  // namespace moondb
