// Properties of stdout. Thread-safe.
#pragma once

namespace moondb {

bool IsOnTerminal();  // Returns true if stdout is a terminal.

// Returns true on a terminal that supports colours, unless the variable NO_COLOR (no-color.org) has a value.
bool AreColorsWanted();

}  // namespace moondb
