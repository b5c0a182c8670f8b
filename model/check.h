// Check: an assertion for programming errors. Stays active in release builds. A failed check prints file and line, and
// aborts.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace moondb {

inline void Check(bool condition, const char* claim, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "%s:%d: broken claim: %s\n", file, line, claim);
  std::abort();
}

}  // namespace moondb
