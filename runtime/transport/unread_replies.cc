#include "runtime/transport/unread_replies.h"

#include "model/tcp_info.h"

namespace moondb {

std::optional<std::uint64_t> UnreadReplies::AckedBytesOf(int file) {
  const std::optional<TcpInfo> info = ReadTcpInfo(file);
  return info ? info->bytes_acked : std::nullopt;
}

void UnreadReplies::OnRequest(const std::string& route, const std::string& key, int file) {
  // A descriptor belongs to one connection. An earlier connection with the same descriptor has closed.
  std::erase_if(connections_, [&](const auto& entry) { return entry.second.file == file && entry.first != route; });
  Connection& connection = connections_[route];
  connection.key = key;
  connection.file = file;
}

std::optional<std::uint64_t> UnreadReplies::WaitingOf(const Connection& connection) const {
  const std::optional<std::uint64_t> acked = acked_bytes_(connection.file);
  // A smaller count means that the kernel reused the descriptor for another connection.
  if (!acked || *acked < connection.acked_before) return std::nullopt;
  const std::uint64_t taken = *acked - connection.acked_before;
  return taken < connection.given ? connection.given - taken : 0;
}

bool UnreadReplies::HasRoom(const std::string& route, std::uint64_t bytes) {
  const auto asking = connections_.find(route);
  if (asking == connections_.end()) return true;
  const std::string key = asking->second.key;
  std::uint64_t of_key = 0;
  std::uint64_t of_all = 0;
  for (auto entry = connections_.begin(); entry != connections_.end();) {
    const std::optional<std::uint64_t> waiting = WaitingOf(entry->second);
    if (!waiting) {
      entry = connections_.erase(entry);
      continue;
    }
    if (entry->second.key == key) of_key += *waiting;
    of_all += *waiting;
    ++entry;
  }
  const auto fits = [bytes](std::uint64_t waiting, std::uint64_t max) {
    return waiting == 0 || waiting + bytes <= max;
  };
  return fits(of_key, kOfKeyMax) && fits(of_all, kOfAllMax);
}

void UnreadReplies::Count(const std::string& route, std::uint64_t bytes) {
  const auto found = connections_.find(route);
  if (found == connections_.end()) return;
  Connection& connection = found->second;
  if (WaitingOf(connection).value_or(0) == 0) {
    connection.acked_before = acked_bytes_(connection.file).value_or(0);
    connection.given = 0;
  }
  connection.given += bytes;
}

std::string UnreadReplies::KeyOf(const std::string& route) const {
  const auto found = connections_.find(route);
  return found == connections_.end() ? std::string() : found->second.key;
}

}  // namespace moondb
