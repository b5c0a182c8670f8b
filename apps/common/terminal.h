// Properties of stdout. Plain functions, thread-safe.
#pragma once

namespace moondb {

bool IsOnTerminal();  // stdout is a terminal.

// Returns true on a terminal that supports colours, unless NO_COLOR (no-color.org) has a value.
bool AreColorsWanted();

}  // namespace moondb
