#include "actors/clock/clock_actor.h"

#include "model/team_member.h"

namespace moondb {

void ClockActor::OnStart(Context& context) { context.WatchPeers(); }

void ClockActor::OnMessage(Context& context, const proto::Message& message) {
  const AgentId sender = context.sender().agent;
  if (sender == options_.self) {
    if (message.has_peer_event()) OnPeerEvent(context, message.peer_event());
    if (message.has_clock_jumped()) {
      for (const AgentId peer : connected_) Notify(context, peer);
    }
  } else if (message.has_clock_report() && FindAgent(options_.team, sender) != nullptr) {
    proto::Message peer_clock;
    peer_clock.set_ms_type(proto::CONTROL);
    peer_clock.mutable_peer_clock()->set_peer(sender);
    peer_clock.mutable_peer_clock()->set_utc_ns(message.clock_report().utc_ns());
    (void)context.Send({options_.self, actor_name::kStorage}, std::move(peer_clock));
  }
}

void ClockActor::OnPeerEvent(Context& context, const proto::PeerEvent& event) {
  if (event.is_connected()) {
    connected_.insert(event.peer());
    Notify(context, event.peer());
  } else {
    connected_.erase(event.peer());
  }
}

void ClockActor::Notify(Context& context, AgentId peer) const {
  proto::Message report;
  report.set_ms_type(proto::CONTROL);
  report.mutable_clock_report()->set_utc_ns(context.utc_now_ns());
  (void)context.Send({peer, actor_name::kClock},
                     std::move(report));  // If the report is lost, the next connection sends another.
}

}  // namespace moondb
