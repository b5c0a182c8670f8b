// Two moondb agents in one process, each with its ZeroMqTransport, over loopback TCP: what a message costs from one
// agent to an actor of the other. Everything has its defaults, but for the receiver's mailbox: a transport never waits
// for an actor, and a bench that sends as fast as it can must not lose what an actor is too slow for.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

// Messages a second of so many bytes, as serialised, from an outside thread to an actor.
Result<double> MoondbRemoteThroughput(bool is_curve, std::size_t bytes, std::uint64_t count);

// Microseconds from an actor to the other agent's and back.
Result<double> MoondbRemoteRoundTrip(bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
