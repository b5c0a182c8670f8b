// What a key looks like, to agents and to their clients.
#pragma once

#include <cstddef>

namespace moondb {

inline constexpr std::size_t kCurveKeyLength = 40;  // Z85 of 32 bytes.

}  // namespace moondb
