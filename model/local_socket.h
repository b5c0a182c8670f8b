// Sockets of this machine: how long their paths may be, and whether somebody listens. Plain function, any thread.
#pragma once

#include <cstddef>
#include <string>

namespace moondb {

inline constexpr std::size_t kSocketPathLengthMax = 107;  // sockaddr_un, less its final 0.

// Of the socket at `path`: 0 where somebody listens, else why not, as an errno: ENOENT for no socket, ECONNREFUSED for
// one that a dead process left. At once; libzmq would try again and again without a word.
int ProbeLocalSocket(const std::string& path);

}  // namespace moondb
