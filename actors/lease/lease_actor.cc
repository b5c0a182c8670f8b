#include "actors/lease/lease_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "model/control_message.h"
#include "model/team_member.h"
#include "proto/control.pb.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kAnnounce = 1, kExpiry = 2 };

// An agent numbers its announcements in ascending order from a random start. An announcement is late if its number is
// below the last number by at most this value. If the two numbers differ by more, the agent restarted between the two
// announcements.
constexpr std::uint64_t kNumbersOfOneBoot = 1 << 20;

Result<void> CheckAnnouncement(const proto::LeaseAnnounce& announce) {
  if (auto checked = CheckLeaseSeconds(announce.driving_s(), "driving_s"); !checked) return checked;
  if (auto checked = CheckLeaseSeconds(announce.sleeping_s(), "sleeping_s"); !checked) return checked;
  return CheckLeaseSeconds(announce.paused_s(), "paused_s");
}

}  // namespace

LeaseActor::LeaseActor(Options options)
    : options_(std::move(options)), leases_(options_.team.radio().quiet_while_driving()) {}

void LeaseActor::OnStart(Context& context) {
  number_ = context.rng()();
  context.WatchPeers();
  OnChange(context);  // Leases that this actor published before a restart may be outdated. Publish them again.
}

void LeaseActor::OnMessage(Context& context, const proto::Message& message) {
  const AgentId from = context.sender().agent;
  if (from == options_.self) return OnLocal(context, message);
  if (FindAgent(options_.team, from) == nullptr) return;
  if (message.has_lease_announce()) OnLeaseAnnounce(context, from, message.lease_announce());
}

void LeaseActor::OnLocal(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    case proto::Message::kPeerEvent:
      return OnPeerEvent(context, message.peer_event());
    case proto::Message::kLeaseRequest:
      return OnLeaseRequest(context, message.lease_request());
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    default:
      return;
  }
}

void LeaseActor::OnTimer(Context& context, const proto::Timer& timer) {
  switch (timer.kind()) {
    case kAnnounce:
      announce_timer_ = 0;
      announce_delay_ = std::min(2 * announce_delay_, options_.announce_after_max);
      return AnnounceToUnknowing(context);
    case kExpiry:
      expiry_timer_ = 0;
      return OnChange(context);
    default:
      return;
  }
}

void LeaseActor::OnPeerEvent(Context& context, const proto::PeerEvent& event) {
  Peer& peer = peers_[event.peer()];
  peer.is_connected = event.is_connected();
  peer.knows_ours = false;  // The peer may have restarted and lost this agent's leases.
  if (peer.is_connected) RestartAnnouncing(context);
}

void LeaseActor::OnLeaseRequest(Context& context, const proto::LeaseRequest& request) {
  const Result<void> taken = Take(context, request);
  proto::Message reply;
  reply.set_ms_type(proto::CONTROL);
  if (!taken) *reply.mutable_lease_reply()->mutable_error() = ToProto(taken.error());
  *reply.mutable_lease_reply()->mutable_leases() = leases_.Left(context.now()).leases();
  (void)context.Reply(std::move(reply));
  if (!taken) return;
  ++number_;
  for (auto& [agent, peer] : peers_) peer.knows_ours = false;
  RestartAnnouncing(context);
  OnChange(context);
}

Result<void> LeaseActor::Take(Context& context, const proto::LeaseRequest& request) {
  if (auto checked = CheckLeaseSeconds(request.seconds(), "lease.seconds"); !checked) return checked;
  proto::AgentLease lease = leases_.LeftOf(options_.self, context.now());
  switch (request.kind()) {
    case proto::LEASE_KIND_DRIVING:
      lease.set_driving_s(request.seconds());
      break;
    case proto::LEASE_KIND_SLEEPING:
      lease.set_sleeping_s(request.seconds());
      break;
    case proto::LEASE_KIND_PAUSED:
      lease.set_paused_s(request.seconds());
      break;
    default:
      return Fail(ErrorCode::kInvalid, "must be driving, sleeping or paused", "lease.kind");
  }
  leases_.Set(lease, context.now());
  return {};
}

void LeaseActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (!request || !request->has_status()) return;
  proto::ControlReply reply;
  *reply.mutable_status()->mutable_leases() = leases_.Left(context.now()).leases();
  (void)context.Reply(MessageOf(reply));
}

void LeaseActor::OnLeaseAnnounce(Context& context, AgentId from, const proto::LeaseAnnounce& announce) {
  if (auto checked = CheckAnnouncement(announce); !checked) {
    refused_log_.Warn(ToString(context.self()) + ": refused the leases that agent " + std::to_string(from) +
                      " announced: " + ToString(checked.error()));
    return;
  }
  Peer& peer = peers_[from];
  const std::uint64_t ahead = announce.number() - peer.heard.value_or(announce.number());
  if (-ahead - 1 < kNumbersOfOneBoot) return;  // The announcement is late: a newer one has arrived.
  if (announce.known_number() == number_) peer.knows_ours = true;
  if (!peer.heard || ahead != 0) {
    peer.heard = announce.number();
    proto::AgentLease lease;
    lease.set_agent_id(from);
    lease.set_driving_s(announce.driving_s());
    lease.set_sleeping_s(announce.sleeping_s());
    lease.set_paused_s(announce.paused_s());
    leases_.Set(lease, context.now());
    OnChange(context);
  }
  if (!announce.is_reply()) Announce(context, from, /*is_reply=*/true);
  if (ahead <= kNumbersOfOneBoot) return;
  // The peer restarted, or this late announcement is from before the peer's restart. Announce again: the peer's reply
  // will contain its current leases.
  peer.knows_ours = false;
  RestartAnnouncing(context);
}

void LeaseActor::Announce(Context& context, AgentId to, bool is_reply) {
  const proto::AgentLease lease = leases_.LeftOf(options_.self, context.now());
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  proto::LeaseAnnounce& announce = *message.mutable_lease_announce();
  announce.set_number(number_);
  announce.set_driving_s(lease.driving_s());
  announce.set_sleeping_s(lease.sleeping_s());
  announce.set_paused_s(lease.paused_s());
  announce.set_known_number(peers_[to].heard.value_or(0));
  announce.set_is_reply(is_reply);
  // If the send fails, the announcement is repeated later.
  (void)context.Send({to, actor_name::kLease}, std::move(message));
}

void LeaseActor::AnnounceToUnknowing(Context& context) {
  bool is_known_to_all = true;
  for (const auto& [agent, peer] : peers_) {
    if (!peer.is_connected || peer.knows_ours) continue;
    Announce(context, agent, /*is_reply=*/false);
    is_known_to_all = false;
  }
  if (!is_known_to_all) announce_timer_ = context.AfterTimer(announce_delay_, kAnnounce);
}

void LeaseActor::RestartAnnouncing(Context& context) {
  if (announce_timer_ != 0) context.Cancel(std::exchange(announce_timer_, 0));
  announce_delay_ = options_.announce_after;
  AnnounceToUnknowing(context);
}

void LeaseActor::OnChange(Context& context) {
  if (expiry_timer_ != 0) context.Cancel(std::exchange(expiry_timer_, 0));
  if (const auto expiry = leases_.NextExpiry(context.now())) {
    expiry_timer_ = context.AfterTimer(*expiry - context.now(), kExpiry);
  }
  proto::Message message;
  message.set_ms_type(proto::EVENT);
  *message.mutable_leases_changed() = leases_.Left(context.now());
  context.Publish(std::move(message));
}

}  // namespace moondb
