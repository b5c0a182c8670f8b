// What libzmq alone does for the pattern of remote_moondb.h: each side a listener (a ROUTER, or as moondb a DEALER with
// CURVE) that only receives and a DEALER that only sends, a context and one I/O thread, no actors, frames that are
// copied and nothing more.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

enum class RawSockets {
  kAsMoondb,  // The options that ZeroMqTransport sets.
  kDefaults,  // libzmq's own.
};

// Errors: a frame that was lost or came out of order.
Result<double> RawThroughput(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);
Result<double> RawRoundTrip(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
