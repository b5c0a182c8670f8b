#include "runtime/transport/unread_replies.h"

#include "model/check.h"
#include "model/tcp_info.h"

namespace moondb {

std::optional<std::uint64_t> UnreadReplies::AckedBytesOf(int file) {
  const std::optional<TcpInfo> info = ReadTcpInfo(file);
  return info ? info->bytes_acked : std::nullopt;
}

void UnreadReplies::OnRequest(const std::string& route, const std::string& key, int file) {
  const std::lock_guard lock(mutex_);
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

UnreadReplies::Sums UnreadReplies::SumUp(const std::string& key) {
  Sums sums;
  for (auto entry = connections_.begin(); entry != connections_.end();) {
    const std::optional<std::uint64_t> waiting = WaitingOf(entry->second);
    if (!waiting) {
      entry = connections_.erase(entry);
      continue;
    }
    if (entry->second.key == key) sums.of_key += *waiting;
    sums.of_all += *waiting;
    ++entry;
  }
  return sums;
}

bool UnreadReplies::HasRoom(const std::string& route, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto asking = connections_.find(route);
  if (asking == connections_.end()) return true;
  const Sums sums = SumUp(std::string(asking->second.key));
  const auto fits = [bytes](std::uint64_t waiting, std::uint64_t max) {
    return waiting == 0 || waiting + bytes <= max;
  };
  return fits(sums.of_key, kOfKeyMax) && fits(sums.of_all, kOfAllMax);
}

void UnreadReplies::Count(const std::string& route, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = connections_.find(route);
  if (found == connections_.end()) return;
  Connection& connection = found->second;
  if (WaitingOf(connection).value_or(0) == 0) {
    connection.acked_before = acked_bytes_(connection.file).value_or(0);
    connection.given = 0;
  }
  connection.given += bytes;
}

void UnreadReplies::AddWaiting(const std::string& key, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  waiting_[key] += bytes;
}

void UnreadReplies::RemoveWaiting(const std::string& key, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = waiting_.find(key);
  Check(found != waiting_.end() && found->second >= bytes, "a reply is removed once");
  found->second -= bytes;
  if (found->second == 0) waiting_.erase(found);
}

std::uint64_t UnreadReplies::OfKey(const std::string& key) {
  const std::lock_guard lock(mutex_);
  const auto waiting = waiting_.find(key);
  return SumUp(key).of_key + (waiting == waiting_.end() ? 0 : waiting->second);
}

}  // namespace moondb
