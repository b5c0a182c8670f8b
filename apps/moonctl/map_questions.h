// `moonctl map why`, `map stats` and `map quarantine`: where the merged map's cells come from, and what to leave out.
#pragma once

#include "apps/moonctl/command_context.h"

namespace CLI {
class App;
}

namespace moondb {

void AddMapQuestions(CLI::App& group, CommandContext& context);

}  // namespace moondb
