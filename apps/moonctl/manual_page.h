// Generates the manual page moonctl.1 from the tree of commands. Thread-safe.
#pragma once

#include <string>

namespace moondb {

class Command;

// Returns the page in roff, with the macros of man(7).
std::string ManualPage(const Command& root, const std::string& version);

}  // namespace moondb
