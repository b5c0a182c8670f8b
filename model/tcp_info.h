// ReadTcpInfo: reads the kernel's statistics of a TCP connection (TCP_INFO).
#pragma once

#include <cstdint>
#include <optional>

namespace moondb {

struct TcpInfo {
  bool is_established = false;  // False once either end has closed the connection.
  // Bytes received since the connection was made. Null if the kernel does not count bytes; then bytes_acked is null,
  // too.
  std::optional<std::uint64_t> bytes_received;
  std::optional<std::uint64_t> bytes_acked;  // Bytes sent that the peer's kernel has acknowledged.
};

// Returns nullopt if the file descriptor is not a TCP connection.
std::optional<TcpInfo> ReadTcpInfo(int file);

}  // namespace moondb
