// PeerOrders: orders peers to share their records with this agent. Each peer has at most one open order.
//
// An order is sent again, with a growing delay, until the peer answers. It is also sent again when the peer reconnects,
// until the peer has reported the order's end, since the peer's process may have restarted and forgotten the order.
//
// A plain state machine like SharingSession: inputs return the messages to send, and the caller calls OnTimer when
// deadline() is reached. The caller adds its term to the messages.
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
    AgentId self = 0;  // The agent with which the peers are to share.
    proto::SharingKind kind = proto::SHARING_KIND_UNSPECIFIED;
    Duration resend_after = std::chrono::seconds(5);
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this.
  };

  explicit PeerOrders(const Options& options) : options_(options) {}

  // Sends an order to the peer. It replaces an order to that peer that has not ended. If the replaced order had no byte
  // limit, neither has the new one. `bytes_max` 0: no limit.
  SharingActions Give(AgentId peer, std::uint64_t number, std::uint64_t bytes_max, Time now);
  // The peer reconnected. Sends its order at once and resets the delay.
  SharingActions OnConnected(AgentId peer, Time now);
  SharingActions OnTimer(Time now);
  // Accepts the peer's answer to an order. `is_taken`: the peer accepted the order. Returns true if the order of that
  // number was waiting for an answer.
  bool TakeAnswer(AgentId peer, std::uint64_t number, bool is_taken);
  // The peer reported the end of the order `number`. Removes that order and earlier ones.
  void TakeEnd(AgentId peer, std::uint64_t number);
  void Cancel(AgentId peer) { orders_.erase(peer); }
  void CancelAll() { orders_.clear(); }

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
