// The part of SharingActor that reports the progress of orders to clients.
#include <algorithm>
#include <utility>

#include "actors/sharing/sharing_actor.h"
#include "model/control_request.h"
#include "model/order_number.h"
#include "proto/control.pb.h"

namespace moondb {
namespace {

// A peer that was lost less than this time ago does not count as out of reach, since it is likely to reconnect.
constexpr Duration kReconnectMax = std::chrono::seconds(5);

proto::PairProgress MakeRow(AgentId sender, AgentId destination, proto::SharingKind kind) {
  proto::PairProgress row;
  row.set_sender(sender);
  row.set_destination(destination);
  row.set_kind(kind);
  return row;
}

}  // namespace

void SharingActor::OnProgressRequest(Context& context, const proto::Message& message) {
  const proto::ShareProgressRequest& request = message.share_progress_request();
  OrderWatch::Request waiting{context.sender().agent, context.sender().actor, message.request_id(), request.order()};
  waiting.until = context.now() + BoundedWait(request.wait_s(), kReadWaitMax_s);
  waiting.after_version = request.after_version();
  waiting.news_period = request.is_relayed() ? OrderWatch::kRelayedNewsPeriod : OrderWatch::kNewsPeriod;
  if (const Result<void> waits = watch_.Wait(std::move(waiting)); !waits) {
    proto::Message reply;
    reply.set_ms_type(proto::CONTROL);
    *reply.mutable_share_progress()->mutable_error() = ToProto(waits.error());
    (void)context.Reply(std::move(reply));
  }
}

void SharingActor::WatchOrder(const Context& context, const proto::ShareRequest& request) {
  OrderWatch::Order order;
  order.number = in_hand_.number;
  order.term = roles_.term();
  order.is_by_role = request.destination() == 0 || request.destination() == options_.self;
  order.pairs = std::move(pairs_in_hand_);
  // An order with a byte limit may end before all records are gathered, so such an order does not wait for gathering.
  order.is_gathering_meant = order.is_by_role && is_leading() && request.bytes_max() == 0;
  order.gathering_of = {request.from_agents().begin(), request.from_agents().end()};
  for (OrderWatch::Pair& pair : order.pairs) {
    const SharingReceiver::Heard& heard = receiver_->heard(pair.peer);
    pair.batches_before = heard.batches;
    pair.refusals_before = heard.refusals;
    pair.coded_bytes_before =
        pair.is_incoming ? heard.coded_bytes : FindOutgoing(pair.peer)->session.Status(context.now()).coded_bytes();
  }
  watch_.Add(std::move(order));
}

void SharingActor::AnswerWhoWaits(Context& context) {
  const auto rows_of = [this, &context](OrderWatch::Order& order) { return RowsOf(context, order); };
  for (OrderWatch::Answer& answer : watch_.CollectAnswers(context.now(), rows_of)) {
    proto::Message message;
    message.set_ms_type(proto::CONTROL);
    message.set_request_id(answer.request.request_id);
    if (answer.request.is_for_end) {
      proto::ShareReply& reply = *message.mutable_share_reply();
      if (answer.progress.has_error()) *reply.mutable_error() = answer.progress.error();
      *reply.mutable_roles() = roles_;
      reply.set_order(answer.progress.order());
      reply.set_session_count(static_cast<std::uint32_t>(answer.progress.pairs_size()));
      *reply.mutable_progress() = std::move(answer.progress);
    } else {
      *message.mutable_share_progress() = std::move(answer.progress);
    }
    (void)context.Send({answer.request.agent, answer.request.actor}, std::move(message));
  }
  Arm(context, watch_timer_, watch_.deadline(), kWatch, 0);
}

OrderWatch::Rows SharingActor::RowsOf(const Context& context, OrderWatch::Order& order) {
  OrderWatch::Rows rows;
  for (const OrderWatch::Pair& pair : order.pairs) {
    rows.pairs.push_back(pair.is_incoming ? IncomingRow(context, order.number, pair)
                                          : OutgoingRow(context, order.number, pair));
  }
  rows.is_open_ended = IsToOpenAgain(order.number);
  if (!order.is_gathering_meant) return rows;
  const std::optional<std::vector<AgentId>> left = YetToGather();
  rows.is_open_ended = rows.is_open_ended || !left;
  if (!left) return rows;
  for (const AgentId agent : *left) {
    if (order.gathering_of.empty() || order.gathering_of.contains(agent)) order.gathers_from.insert(agent);
  }
  for (const AgentId agent : order.gathers_from) {
    proto::PairProgress& row = rows.pairs.emplace_back(MakeRow(agent, options_.self, proto::SHARING_KIND_REPLICATION));
    row.set_is_complete(std::find(left->begin(), left->end(), agent) == left->end());
    if (row.is_complete()) continue;
    AddObstacle(context, agent, row);
    const auto refusal = order_refusals_.find(agent);
    if (kind_ == proto::SHARING_KIND_REPLICATION && refusal != order_refusals_.end()) row.set_why(refusal->second);
    // If an agent drives or sleeps, its records are gathered when its window opens. The order does not wait for these
    // records.
    row.set_is_stopped(!row.why().empty());
  }
  return rows;
}

proto::PairProgress SharingActor::OutgoingRow(const Context& context, std::uint64_t order,
                                              const OrderWatch::Pair& pair) {
  proto::PairProgress row = MakeRow(options_.self, pair.peer, kind_);
  const Outgoing* outgoing = FindOutgoing(pair.peer);
  const proto::ShareSession status = outgoing->session.Status(context.now());
  row.set_coded_bytes(status.coded_bytes() - pair.coded_bytes_before);
  row.set_missing(status.remaining());
  row.set_is_missing_known(status.is_remaining_known());
  switch (outgoing->session.StateOf({options_.self, order})) {
    case StandingOrder::Reached::kCompleted:
      row.set_is_complete(true);
      return row;
    case StandingOrder::Reached::kOpen:
      if (outgoing->session.is_refused_again()) {
        row.set_is_stopped(true);
        row.set_why(status.last_error());
      }
      AddObstacle(context, pair.peer, row);
      return row;
    case StandingOrder::Reached::kLimited:
      row.set_is_limited(true);
      [[fallthrough]];
    default:
      row.set_is_stopped(true);
      row.set_why(status.last_error().empty() ? "a newer order replaced it" : status.last_error());
      return row;
  }
}

proto::PairProgress SharingActor::IncomingRow(const Context& context, std::uint64_t order,
                                              const OrderWatch::Pair& pair) const {
  proto::PairProgress row = MakeRow(pair.peer, options_.self, kind_);
  const SharingReceiver::Heard& heard = receiver_->heard(pair.peer);
  row.set_coded_bytes(heard.coded_bytes - pair.coded_bytes_before);
  row.set_is_missing_known(heard.batches > pair.batches_before);
  row.set_missing(static_cast<double>(heard.remaining));
  const std::optional<proto::OrderEnd> end = OrderEndBy(pair.peer);
  if (HasReached(last_order_, heard.completed_order) && HasReached(heard.completed_order, order)) {
    row.set_is_complete(true);
    return row;
  }
  if (end && HasReached(end->order(), order)) {
    row.set_is_limited(end->is_limited());
    row.set_is_stopped(true);
    if (end->is_limited())
      row.set_why("stopped at the byte limit of this request; repeat it to send the other records");
    if (end->not_taken() > 0) {
      row.set_why("the destination did not accept " + std::to_string(end->not_taken()) + " records");
    }
    return row;
  }
  if (const auto refusal = order_refusals_.find(pair.peer); refusal != order_refusals_.end()) {
    row.set_is_stopped(true);
    row.set_why(refusal->second);
    return row;
  }
  if (heard.refusals - pair.refusals_before > 1) {
    row.set_is_stopped(true);
    row.set_why("the destination refused: " + heard.refusal);
  }
  AddObstacle(context, pair.peer, row);
  return row;
}

void SharingActor::AddObstacle(const Context& context, AgentId peer, proto::PairProgress& row) const {
  if (IsOutOfReach(context, peer)) {
    row.set_is_stopped(true);
    row.set_is_out_of_reach(true);
    row.set_why("is out of reach");
  } else if (!IsWindowOpen(context, peer)) {
    row.set_is_stopped(false);
    row.set_why(WhyWindowIsShut(context, peer));
    row.set_waits_for_s(SecondsUntilWindowOpens(context, peer));
  }
}

bool SharingActor::IsOutOfReach(const Context& context, AgentId peer) const {
  const auto lost_at = lost_at_.find(peer);
  return lost_at != lost_at_.end() && context.now() - lost_at->second >= kReconnectMax;
}

}  // namespace moondb
