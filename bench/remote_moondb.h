// Measures the cost of sending a message from one agent to an actor of another. Both agents run in this process, each
// with a ZeroMqTransport, over loopback TCP.
//
// All settings are defaults except for the receiver's mailbox, which is larger: it must not drop messages that its
// actor has not handled yet. A transport never waits for an actor, and this benchmark sends as fast as possible.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

// Returns messages per second from an outside thread of one agent to an actor of the other. A message has `bytes` bytes
// when serialised.
Result<double> MoondbRemoteThroughput(bool is_curve, std::size_t bytes, std::uint64_t count);

// Returns microseconds per round trip between actors of the two agents.
Result<double> MoondbRemoteRoundTrip(bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
