// Functions for the endpoints that an agent listens on: free a stale ipc:// path, resolve a host name to a numeric
// address, and extract port and address.
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

// Converts a host name to a number, since libzmq can listen only on numeric addresses: "tcp://localhost:7400" becomes
// "tcp://127.0.0.1:7400". Uses the system's resolver. Returns kUnavailable if the name is unknown.
Result<std::string> NumericEndpoint(const std::string& endpoint);

// TcpPortOf returns the port of a TCP endpoint, NumericAddressOf its numeric address: 7400 and "10.0.0.3" for
// "tcp://10.0.0.3:7400". The address of localhost is "127.0.0.1". For endpoints other than TCP they return nothing and
// "". NumericAddressOf also returns "" for other host names, because it does no lookup.
std::optional<std::uint16_t> TcpPortOf(const std::string& endpoint);
std::string NumericAddressOf(const std::string& endpoint);

}  // namespace moondb
