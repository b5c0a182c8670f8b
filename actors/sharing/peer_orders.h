// PeerOrders: orders peers to share their records with this agent. Each peer has at most one open order.
//
// An order is sent again, with a growing delay, until the peer answers. If the peer reconnects before it has reported
// the order's end, the order is sent again, since the peer's process may have restarted and forgotten the order.
//
// A state machine: inputs return the messages to send, and the caller calls OnTimer when deadline() is reached. The
// caller adds its term to the messages.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "actors/sharing/resend_delay.h"
#include "actors/sharing/sharing_action.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

class PeerOrders {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  struct Options {
    AgentId self = 0;  // This agent, to which the peers are to send their records.
    proto::SharingKind kind = proto::SHARING_KIND_UNSPECIFIED;
    Duration resend_after = std::chrono::seconds(5);
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this value.
  };

  explicit PeerOrders(const Options& options) : options_(options) {}

  // Sends an order to the peer. Replaces an open order to the peer; if the replaced order had no byte limit, the new
  // order has none either. `bytes_max` 0: no limit.
  SharingActions Place(AgentId peer, std::uint64_t number, std::uint64_t bytes_max, Time now);
  // Call when the peer reconnected. Sends the open order to the peer immediately and resets the delay.
  SharingActions OnConnected(AgentId peer, Time now);
  SharingActions OnTimer(Time now);
  // Call when the peer answered the order `number`. Stops repeating the order if the peer accepted it (`is_taken`), and
  // removes the order if the peer refused it. Returns false, and changes nothing, if the order `number` was not waiting
  // for an answer.
  bool TakeAnswer(AgentId peer, std::uint64_t number, bool is_taken);
  // Call when the peer reported the end of the order `number`. Removes the open order to the peer if its number is
  // `number` or lower.
  void TakeEnd(AgentId peer, std::uint64_t number);
  void Cancel(AgentId peer) { orders_.erase(peer); }
  void CancelAll() { orders_.clear(); }

  bool is_empty() const { return orders_.empty(); }  // No peer has an open order.
  std::optional<Time> deadline() const;

 private:
  struct Order {
    std::uint64_t number = 0;
    std::uint64_t bytes_max = 0;
    ResendDelay delay;
    Time due{};
    bool is_answered = false;
  };

  SharingAction Send(AgentId peer, Order& order, Time now) const;

  const Options options_;
  std::map<AgentId, Order> orders_;  // By the peer that receives the order.
};

}  // namespace moondb
