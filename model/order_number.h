// Order numbers: identify the sharing orders that one actor has given since its restart; a later order has a higher
// number.
//
// The actor draws the upper 32 bits at random when it starts; the lower bits count from 1. Orders from before and after
// a restart cannot be compared. 0 means no order.
#pragma once

#include <cstdint>

namespace moondb {

// Returns the number from which an actor counts its orders after a restart; the first order has this number plus 1.
// `random`: a new random number.
inline std::uint64_t BeginOrderNumbers(std::uint64_t random) { return random << 32; }

inline bool IsOfOneBoot(std::uint64_t a, std::uint64_t b) { return a >> 32 == b >> 32; }

// Returns whether `reached` is `order`, or a later order without a restart between the two.
inline bool HasReached(std::uint64_t reached, std::uint64_t order) {
  return reached != 0 && IsOfOneBoot(reached, order) && reached >= order;
}

}  // namespace moondb
