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
  // Messages per second from `sender_count` threads outside the actor system to one actor. `count` is the number of
  // messages of all threads together.
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

// Returns the functions for moondb. The messages have no body; request_id holds each message's number.
InProcess MoondbInProcess();
// Returns the functions for the C++ Actor Framework, used as in its manual. Each message is one uint64_t.
InProcess CafInProcess();
// Returns functions that do the same work in plain C++, without an actor library. They show the best possible result on
// this machine. Threads pass numbers through a bounded deque with a mutex, and the reader takes all waiting numbers at
// once. A ring is a chain of virtual calls. In a round trip two threads wake each other.
InProcess LimitInProcess();

}  // namespace moondb
