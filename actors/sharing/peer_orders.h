// PeerOrders: "share with me", to one peer each, again and again with a growing delay until it answers; and again when
// the peer is reached again, until it has told the order's end, since its process may have forgotten the order.
//
// A plain state machine like SharingSession: inputs return what is to be sent, and OnTimer is called when deadline()
// has come. The sender completes the messages with its term.
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
    AgentId self = 0;  // Whom the peers are to share with.
    proto::SharingKind kind = proto::SHARING_KIND_UNSPECIFIED;
    Duration resend_after = std::chrono::seconds(5);
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this.
  };

  explicit PeerOrders(const Options& options) : options_(options) {}

  // An order to that peer that has not ended gives way to this one; where it had no limit, neither has this one.
  // `bytes_max` 0: no limit.
  SharingActions Give(AgentId peer, std::uint64_t number, std::uint64_t bytes_max, Time now);
  // The peer was reached again: its order is sent at once, and the delay is the shortest again.
  SharingActions OnConnected(AgentId peer, Time now);
  SharingActions OnTimer(Time now);
  // True where the order of that number waited for this answer. `is_taken`: the peer shares.
  bool TakeAnswer(AgentId peer, std::uint64_t number, bool is_taken);
  // The peer has told how this order, or a later one, ended.
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
  std::map<AgentId, Order> orders_;  // By whom they go to.
};

}  // namespace moondb
