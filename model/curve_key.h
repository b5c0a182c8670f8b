// Format of the keys for CURVE, ZeroMQ's encryption.
#pragma once

#include <cstddef>

namespace moondb {

inline constexpr std::size_t kCurveKeyLength = 40;  // Characters of a 32-byte key in Z85.

}  // namespace moondb
