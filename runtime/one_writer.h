// Increase: increments a counter that one thread at a time writes and any thread reads. Costs as little as a non-atomic
// increment.
#pragma once

#include <atomic>
#include <type_traits>

namespace moondb {

template <typename T>
void Increase(std::atomic<T>& counter, std::type_identity_t<T> by) {
  counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

}  // namespace moondb
