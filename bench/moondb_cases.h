// moondb's side of the cases within one process. A small message is one without a body, its number in request_id.
// Everything has its defaults, but where it says otherwise. Errors: a message that was lost or came out of order.
#pragma once

#include <cstdint>

#include "model/error.h"

namespace moondb {

// Messages a second from `sender_count` outside threads to one actor; `count` of all senders together.
Result<double> MoondbFanIn(int sender_count, std::uint64_t count);

// Messages a second from one actor to another, in bursts of kBurstMessages of which the last is acknowledged.
Result<double> MoondbActorToActor(std::uint64_t count);

// Microseconds a round trip between two actors, on one worker or on a thread each.
Result<double> MoondbPingPongSameWorker(std::uint64_t count);
Result<double> MoondbPingPongAcrossThreads(std::uint64_t count);

// Hops a second of one message around kRingActors actors.
Result<double> MoondbRing(std::uint64_t count);

inline constexpr std::uint64_t kBurstMessages = 1000;
inline constexpr int kRingActors = 1000;

}  // namespace moondb
