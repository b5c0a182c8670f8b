// Functions for the endpoints that an agent listens on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "model/error.h"

namespace moondb {

// Removes the socket file of an ipc:// endpoint if no process listens on it. libzmq would otherwise take over the path
// of a running listener. Returns kUnavailable "cannot listen on ipc://...: Address already in use" if a process
// listens, kInvalid if the file is not a socket. Other endpoints: no effect.
Result<void> ClaimIpcPath(const std::string& endpoint);

// Returns a TCP endpoint with its host name replaced by the numeric IPv4 address, because libzmq can listen only on
// numeric addresses: "tcp://localhost:7400" becomes "tcp://127.0.0.1:7400". Returns other endpoints unchanged. Uses the
// system's resolver. Returns kUnavailable if the name is unknown.
Result<std::string> NumericEndpoint(const std::string& endpoint);

// Returns the port of a TCP endpoint, such as 7400 for "tcp://10.0.0.3:7400". Returns nothing for other endpoints.
std::optional<std::uint16_t> TcpPortOf(const std::string& endpoint);

// Returns the numeric address of a TCP endpoint, such as "10.0.0.3" for "tcp://10.0.0.3:7400", and "127.0.0.1" for
// localhost. Returns "" for other host names, because it does no lookup, and for other endpoints.
std::string NumericAddressOf(const std::string& endpoint);

// Returns the file of an ipc:// endpoint. Returns "" for other endpoints.
std::string SocketFileOf(const std::string& endpoint);

}  // namespace moondb
