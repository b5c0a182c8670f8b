// Measurements within one process, made in the same way for each contender. Every library has its default settings
// unless a comment says otherwise. A measurement returns an error if a message was lost or arrived out of order.
#pragma once

#include <cstdint>
#include <functional>

#include "bench/measure.h"
#include "model/error.h"

namespace moondb {

inline constexpr std::uint64_t kBurstMessages = 1000;
inline constexpr int kRingActors = 1000;

// Functions that measure one contender. A function is empty if this build does not have the contender.
struct InProcess {
  // Messages per second to one actor from `sender_count` threads that belong to no actor. `count`: number of messages,
  // summed over these threads.
  std::function<Result<double>(int sender_count, std::uint64_t count)> fan_in;
  // Messages per second from one actor to another, sent in bursts of kBurstMessages. The receiver acknowledges the last
  // message of a burst.
  Measure actor_to_actor;
  // Hops per second of one message around kRingActors actors.
  Measure ring;
  // Microseconds per round trip between two actors. In the first case they share one worker; in the second each has its
  // own thread.
  Measure ping_pong_same_worker;
  Measure ping_pong_across_threads;
};

// Returns the functions for moondb. A small message has no body; its number is in request_id.
InProcess MoondbInProcess();
// Returns the functions for the C++ Actor Framework, used as in its manual. A small message is one uint64_t.
InProcess CafInProcess();
// Returns functions that use no actor library: the cost of the pattern itself on this machine. Numbers pass through a
// bounded deque under a mutex, and the reader takes all waiting numbers together. A ring is virtual calls from object
// to object. In a round trip two threads wake each other.
InProcess LimitInProcess();

}  // namespace moondb
