#include "model/tcp_info.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstddef>

namespace moondb {
namespace {

constexpr std::uint8_t kEstablished = 1;  // TCP_ESTABLISHED of netinet/tcp.h, which conflicts with linux/tcp.h.

}  // namespace

std::optional<TcpInfo> ReadTcpInfo(int file) {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(file, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  TcpInfo read;
  read.is_established = info.tcpi_state == kEstablished;
  if (size >= offsetof(tcp_info, tcpi_bytes_received) + sizeof info.tcpi_bytes_received) {
    read.bytes_received = info.tcpi_bytes_received;
  }
  if (size >= offsetof(tcp_info, tcpi_bytes_acked) + sizeof info.tcpi_bytes_acked) {
    read.bytes_acked = info.tcpi_bytes_acked;
  }
  return read;
}

}  // namespace moondb
