// Numbers of orders: which of two was given later by one life of the actor that gives them.
//
// The upper 32 bits are drawn at random when that life begins, the lower ones count from 1. Orders of two lives cannot
// be compared: an order of an earlier life says nothing of one of the present life. 0 is no order.
#pragma once

#include <cstdint>

namespace moondb {

// The number before the first one of a life.
inline std::uint64_t BeginOrderNumbers(std::uint64_t random) { return random << 32; }

inline bool IsOfOneBoot(std::uint64_t a, std::uint64_t b) { return a >> 32 == b >> 32; }

// Whether `reached` is `order`, or a later order of the same life.
inline bool HasReached(std::uint64_t reached, std::uint64_t order) {
  return reached != 0 && IsOfOneBoot(reached, order) && reached >= order;
}

}  // namespace moondb
