// Measures the cost of sending a message from one agent to an actor of another. Both agents run in this process, each
// with a ZeroMqTransport, over loopback TCP.
//
// All settings are defaults, except that the receiver's mailbox is larger: the transport never waits for an actor, so
// the default mailbox would drop messages at full speed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

// Returns the number of messages per second that a thread of one agent sends to an actor of the other agent. The thread
// belongs to no actor. Each message is `bytes` long when serialised.
Result<double> MoondbRemoteThroughput(bool is_curve, std::size_t bytes, std::uint64_t count);

// Returns microseconds per round trip between actors of the two agents.
Result<double> MoondbRemoteRoundTrip(bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
