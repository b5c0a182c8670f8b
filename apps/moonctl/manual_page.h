// The manual page moonctl.1, made from the tree of commands. Pure function.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace moondb {

// In roff, with the macros of man(7).
std::string ManualPage(const CLI::App& root, const std::string& version);

}  // namespace moondb
