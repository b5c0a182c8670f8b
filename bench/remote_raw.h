// Measures libzmq alone with the pattern of remote_moondb.h, without actors. Each side has a listener that only
// receives (a ROUTER, or with kAsMoondb and CURVE a DEALER) and a DEALER that only sends. Each has one context and one
// I/O thread. Frames are copied and not parsed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

enum class RawSockets {
  kAsMoondb,  // The options that ZeroMqTransport sets.
  kDefaults,  // The default options of libzmq.
};

// Errors: a frame that was lost or came out of order.
Result<double> RawThroughput(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);
Result<double> RawRoundTrip(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
