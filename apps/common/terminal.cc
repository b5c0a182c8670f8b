#include "apps/common/terminal.h"

#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace moondb {
namespace {

std::string_view Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

bool IsOnTerminal() { return ::isatty(STDOUT_FILENO) == 1; }

bool AreColorsWanted() { return IsOnTerminal() && Environment("NO_COLOR").empty() && Environment("TERM") != "dumb"; }

}  // namespace moondb
