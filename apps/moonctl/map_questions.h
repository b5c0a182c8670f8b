// `moonctl map why`, `map stats` and `map quarantine`: show which maps a cell of the merged map comes from, and exclude
// maps.
#pragma once

#include "apps/moonctl/command_context.h"

namespace moondb {

class Command;

void AddMapQuestions(Command& group, CommandContext& context);
// Adds `moonctl map overlap`, which draws two local maps over each other.
void AddMapOverlap(Command& group, CommandContext& context);

}  // namespace moondb
