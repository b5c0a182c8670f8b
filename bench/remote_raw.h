// Measures bare libzmq with the message pattern of remote_moondb.h, without actors. Each side has one context, one I/O
// thread, a listener that only receives, and a DEALER that only sends. The listener is a DEALER with kAsMoondb and
// CURVE, and a ROUTER otherwise. Frames are copied and not parsed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/error.h"

namespace moondb {

enum class RawSockets {
  kAsMoondb,  // The options that ZeroMqTransport sets.
  kDefaults,  // The default options of libzmq.
};

// Measure the same as the functions of remote_moondb.h. Return an error if a frame is lost or out of order.
Result<double> RawThroughput(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);
Result<double> RawRoundTrip(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);

}  // namespace moondb
