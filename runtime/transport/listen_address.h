// What must be right about an address before a socket can listen on it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "model/error.h"

namespace moondb {

// For ipc://: libzmq would take over a path from whoever listens there. Removes a socket that nobody listens on.
// kUnavailable "cannot listen on ipc://...: Address already in use"; kInvalid if something else than a socket is there.
// Other addresses: nothing to do.
Result<void> ClaimIpcPath(const std::string& endpoint);

// libzmq listens on numbers only: "tcp://localhost:7400" becomes "tcp://127.0.0.1:7400". Asks the system's resolver.
// kUnavailable if it does not know the name.
Result<std::string> NumericEndpoint(const std::string& endpoint);

// The parts of "tcp://10.0.0.3:7400" are 7400 and "10.0.0.3"; localhost is "127.0.0.1". What is no TCP address has no
// port and an empty address, and so has (NumericAddressOf) a host with another name: nobody is asked for it.
std::optional<std::uint16_t> TcpPortOf(const std::string& endpoint);
std::string NumericAddressOf(const std::string& endpoint);

}  // namespace moondb
