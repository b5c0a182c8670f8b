// LeaseActor ("lease"): tracks which agents of the team drive, sleep or are paused, and for how long (model/leases.h).
//
// Actors of this agent set the agent's leases with a LeaseRequest. Clients send a LeaseRequest through the gateway. The
// LeaseReply contains kInvalid, with the field, if the request is invalid. A change is announced to the LeaseActors of
// all other agents at once, and the leases are announced to each agent that connects. Announcements are repeated, with
// a growing delay, until the other agent acknowledges them. The expiry of a lease is not announced, because every agent
// counts the time down itself. An announcement sets only the leases of its sender.
//
// Publishes LeasesChanged (Topic::kLeases) at each change and expiry. Answers the ControlRequest `status` with the
// leases. Stores nothing: after a restart, an agent has no lease until its robot sets one again.
#pragma once

#include <map>
#include <optional>

#include "model/leases.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class LeaseActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;                             // Requires: complete and validated.
    Duration announce_after = std::chrono::seconds(5);  // Delay before the first retransmission; doubles each time.
    Duration announce_after_max = std::chrono::seconds(60);  // Maximum delay between retransmissions.
  };

  explicit LeaseActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Peer {
    bool is_connected = false;
    bool knows_ours = false;             // The peer has acknowledged number_.
    std::optional<std::uint64_t> heard;  // Number of the peer's latest announcement.
  };

  void OnLocal(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void OnLeaseRequest(Context& context, const proto::LeaseRequest& request);
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnLeaseAnnounce(Context& context, AgentId from, const proto::LeaseAnnounce& announce);

  Result<void> Take(Context& context, const proto::LeaseRequest& request);
  void Announce(Context& context, AgentId to, bool is_reply);
  // Announces this agent's leases to all connected agents that have not acknowledged them, and sets a timer to repeat
  // the announcement.
  void AnnounceToUnknowing(Context& context);
  void RestartAnnouncing(Context& context);  // Announces at once and resets the delay to announce_after.
  void OnChange(Context& context);

  const Options options_;
  Leases leases_;
  std::uint64_t number_ = 0;  // Number of this agent's latest announcement.
  std::map<AgentId, Peer> peers_;
  Duration announce_delay_{};
  TimerId announce_timer_ = 0;
  TimerId expiry_timer_ = 0;
  RateLimitedLog refused_log_;
};

}  // namespace moondb
