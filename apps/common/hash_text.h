// Text form of hashes and epochs. Thread-safe.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

namespace moondb {

// Returns the hash or epoch as 16 hexadecimal digits.
inline std::string HashText(std::uint64_t hash) {
  char text[20];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

}  // namespace moondb
