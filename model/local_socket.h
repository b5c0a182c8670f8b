// Unix domain sockets: the limit of their path length, and a probe for a listener. Thread-safe.
#pragma once

#include <cstddef>
#include <string>

namespace moondb {

inline constexpr std::size_t kSocketPathLengthMax = 107;  // Size of sockaddr_un::sun_path without the final 0.

// Returns 0 if a process listens on the socket at `path`, otherwise an errno: ENOENT if there is no socket,
// ECONNREFUSED if a dead process left the socket behind. Does not wait.
int ProbeLocalSocket(const std::string& path);

}  // namespace moondb
