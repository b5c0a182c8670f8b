// Finds a TCP port of this machine that is free at the time of the call.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include "model/check.h"

namespace moondb {

inline int FreePort() {
  const int probe = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  const bool is_found = ::bind(probe, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 &&
                        ::getsockname(probe, reinterpret_cast<sockaddr*>(&address), &length) == 0;
  Check(is_found, "a test finds a free port");
  ::close(probe);
  return ntohs(address.sin_port);
}

}  // namespace moondb
