#include "actors/sharing/peer_orders.h"

#include <algorithm>

#include "model/order_number.h"

namespace moondb {

SharingActions PeerOrders::Place(AgentId peer, std::uint64_t number, std::uint64_t bytes_max, Time now) {
  const auto open = orders_.find(peer);
  if (open != orders_.end() && open->second.bytes_max == 0) bytes_max = 0;
  const ResendDelay delay(options_.resend_after, options_.resend_after_max);
  Order& order = orders_.insert_or_assign(peer, Order{number, bytes_max, delay, {}, false}).first->second;
  return {Send(peer, order, now)};
}

SharingActions PeerOrders::OnConnected(AgentId peer, Time now) {
  const auto order = orders_.find(peer);
  if (order == orders_.end()) return {};
  order->second.delay.Reset();
  return {Send(peer, order->second, now)};
}

SharingActions PeerOrders::OnTimer(Time now) {
  SharingActions actions;
  for (auto& [peer, order] : orders_) {
    if (order.is_answered || now < order.due) continue;
    order.delay.Grow();
    actions.push_back(Send(peer, order, now));
  }
  return actions;
}

bool PeerOrders::TakeAnswer(AgentId peer, std::uint64_t number, bool is_taken) {
  const auto order = orders_.find(peer);
  if (order == orders_.end() || order->second.number != number || order->second.is_answered) return false;
  order->second.is_answered = true;
  if (!is_taken) orders_.erase(order);
  return true;
}

void PeerOrders::TakeEnd(AgentId peer, std::uint64_t number) {
  const auto order = orders_.find(peer);
  if (order != orders_.end() && HasReached(number, order->second.number)) orders_.erase(order);
}

std::optional<PeerOrders::Time> PeerOrders::deadline() const {
  std::optional<Time> first;
  for (const auto& [peer, order] : orders_) {
    if (!order.is_answered) first = first ? std::min(*first, order.due) : order.due;
  }
  return first;
}

SharingAction PeerOrders::Send(AgentId peer, Order& order, Time now) const {
  order.due = now + order.delay.delay();
  order.is_answered = false;
  SharingAction action{peer, {}};
  action.message.set_ms_type(proto::CONTROL);
  // The answer repeats this number, so a late answer to an older order can be ignored.
  action.message.set_request_id(order.number);
  proto::ShareRequest& request = *action.message.mutable_share_request();
  request.set_kind(options_.kind);
  request.set_destination(options_.self);
  request.set_bytes_max(order.bytes_max);
  request.set_order(order.number);
  return action;
}

}  // namespace moondb
