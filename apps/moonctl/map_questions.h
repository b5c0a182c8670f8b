// `moonctl map why`, `map stats` and `map quarantine`: where the merged map's cells come from, and what to leave out.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

void AddMapQuestions(Command& group, CommandContext& context);

}  // namespace moondb
