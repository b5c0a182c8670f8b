// What stdout is. Plain functions, any thread.
#pragma once

namespace moondb {

bool IsOnTerminal();  // stdout is a terminal.

// On a terminal that knows colours, unless NO_COLOR (no-color.org) is set to anything.
bool AreColorsWanted();

}  // namespace moondb
