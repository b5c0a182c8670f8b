// ReadTcpInfo: what the kernel says of one TCP connection (TCP_INFO).
#pragma once

#include <cstdint>
#include <optional>

namespace moondb {

struct TcpInfo {
  bool is_established = false;  // False once an end has closed it.
  // Since the connection was made; none: the kernel does not count them.
  std::optional<std::uint64_t> bytes_received;
  std::optional<std::uint64_t> bytes_acked;  // Bytes of this end that the peer's system has acknowledged.
};

// None: the file is no TCP connection.
std::optional<TcpInfo> ReadTcpInfo(int file);

}  // namespace moondb
