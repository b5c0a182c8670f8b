// What is measured within one process, of each contender in the same way. Everything has its library's defaults, but
// where it says otherwise. Errors: a message that was lost or came out of order.
#pragma once

#include <cstdint>
#include <functional>

#include "bench/measure.h"
#include "model/error.h"

namespace moondb {

inline constexpr std::uint64_t kBurstMessages = 1000;
inline constexpr int kRingActors = 1000;

// A function that is empty: not in this build.
struct InProcess {
  // Messages a second from so many outside threads to one actor; `count` is of all together.
  std::function<Result<double>(int sender_count, std::uint64_t count)> fan_in;
  // Messages a second from one actor to another, in bursts of kBurstMessages of which the last is acknowledged.
  Measure actor_to_actor;
  // Hops a second of one message around kRingActors actors.
  Measure ring;
  // Microseconds a round trip between two actors, on one worker or on a thread each.
  Measure ping_pong_same_worker;
  Measure ping_pong_across_threads;
};

// A small message is one without a body, its number in request_id.
InProcess MoondbInProcess();
// The C++ Actor Framework, as its manual shows it. A small message is one uint64_t.
InProcess CafInProcess();
// No actor library: what the pattern itself costs on this machine. Numbers through a bounded deque under a mutex, whose
// reader takes all that waits at once; virtual calls from object to object; two threads that wake each other.
InProcess LimitInProcess();

}  // namespace moondb
