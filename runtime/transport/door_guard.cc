#include "runtime/transport/door_guard.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

namespace moondb {
namespace {

std::set<std::uint16_t> PortsOf(const std::map<std::uint16_t, ConnectionRules::Door>& doors) {
  std::set<std::uint16_t> ports;
  for (const auto& [port, door] : doors) ports.insert(port);
  return ports;
}

}  // namespace

Result<std::unique_ptr<DoorGuard>> DoorGuard::Make(std::map<std::uint16_t, ConnectionRules::Door> doors) {
  Result<std::unique_ptr<TcpConnections>> connections = TcpConnections::Watch(PortsOf(doors));
  if (!connections) return tl::unexpected(connections.error());
  return std::unique_ptr<DoorGuard>(new DoorGuard(std::move(*connections), std::move(doors)));
}

DoorGuard::DoorGuard(std::unique_ptr<TcpConnections> connections, std::map<std::uint16_t, ConnectionRules::Door> doors)
    : connections_(std::move(connections)), rules_(std::move(doors)) {}

void DoorGuard::OnReadable(MonotonicTime now) {
  connections_->Drain();
  next_look_after_ = kLookAfter;
  looks_at_ = std::min(looks_at_, now + kLookAfter);
}

void DoorGuard::Work(MonotonicTime now) {
  if (now < looks_at_) return;
  looks_at_ = next_look_after_ <= kLookAfterMax ? now + next_look_after_ : MonotonicTime::max();
  next_look_after_ *= 2;
  for (const ConnectionRules::Cut& cut : rules_.Judge(connections_->List())) {
    TcpConnections::ShutDown(cut.connection);
    const std::string who =
        "a connection from " + cut.connection.peer + " to port " + std::to_string(cut.connection.port);
    if (cut.cause == ConnectionRules::Cause::kTooMuch) {
      ++cut_for_bytes_;
      bytes_log_.Warn("transport: cut " + who + ": it sends a message without an end");
    } else {
      ++cut_for_number_;
      const bool is_of_key = cut.cause == ConnectionRules::Cause::kTooManyOfKey;
      number_log_.Warn("transport: cut " + who + ": there are too many " + (is_of_key ? "of its key" : "from there"));
    }
  }
}

}  // namespace moondb
