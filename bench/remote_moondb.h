// Measures the cost of a message from one agent to an actor of another. Both agents run in this process, each with a
// ZeroMqTransport, over loopback TCP.
//
// All settings are defaults except for the receiver's mailbox. A transport never waits for an actor, and this bench
// sends as fast as possible. The mailbox must not drop messages that the actor has not handled yet.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

// Messages per second, of `bytes` bytes when serialised, from an outside thread to an actor.
Result<double> MoondbRemoteThroughput(bool is_curve, std::size_t bytes, std::uint64_t count);

// Microseconds per round trip between an actor and an actor of the other agent.
Result<double> MoondbRemoteRoundTrip(bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
