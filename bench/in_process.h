// Measurements within one process, made in the same way for each contender. Every library has its default settings
// unless a comment says otherwise. Errors: a message that was lost or arrived out of order.
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
  // Messages per second from `sender_count` outside threads to one actor; `count` is the total of all threads.
  std::function<Result<double>(int sender_count, std::uint64_t count)> fan_in;
  // Messages per second from one actor to another, in bursts of kBurstMessages. The last message of a burst is
  // acknowledged.
  Measure actor_to_actor;
  // Hops per second of one message around kRingActors actors.
  Measure ring;
  // Microseconds per round trip between two actors, which share one worker or have one thread each.
  Measure ping_pong_same_worker;
  Measure ping_pong_across_threads;
};

// moondb. A small message has no body; its number is in request_id.
InProcess MoondbInProcess();
// The C++ Actor Framework, used as in its manual. A small message is one uint64_t.
InProcess CafInProcess();
// No actor library: the cost of the pattern itself on this machine. Numbers pass through a bounded deque under a mutex,
// whose reader takes all waiting numbers at once. A ring is virtual calls from object to object. A round trip is two
// threads that wake each other.
InProcess LimitInProcess();

}  // namespace moondb
