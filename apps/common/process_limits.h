// Limits of a process that runs an agent.
#pragma once

#include <cstdint>

namespace moondb {

// libzmq aborts the process if it cannot open another file for a connection. This limit is far above 16 times the
// connections that ConnectionLimiter admits over TCP for an agent of the largest team, including connections in their
// handshake. Connections over ipc take at most a quarter of the files (LocalConnections::LimitFor).
inline constexpr std::uint64_t kOpenFilesLeast = 8'192;

}  // namespace moondb
