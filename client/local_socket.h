// Whether somebody listens at a socket of this machine. Plain function, any thread.
#pragma once

#include <string>

namespace moondb {

// Of the socket at `path`: 0 where somebody listens, else why not, as an errno: ENOENT for no socket, ECONNREFUSED for
// one that a dead process left. At once; libzmq would try again and again without a word.
int ProbeLocalSocket(const std::string& path);

}  // namespace moondb
