// The same cases as moondb_cases.h without any actor library: what the pattern itself costs on this machine.
#pragma once

#include <cstdint>

#include "model/error.h"

namespace moondb {

// A deque of numbers under a mutex, bounded as a mailbox is; its reader takes all that waits at once.
Result<double> LimitFanIn(int sender_count, std::uint64_t count);

// A virtual call from object to object, of `object_count` that lie around in memory: hops a second.
double LimitCalls(int object_count, std::uint64_t count);

// Two threads that wake each other, a mutex and a condition variable for each way: microseconds a round trip.
double LimitHandover(std::uint64_t count);

}  // namespace moondb
