// LeaseActor ("lease"): knows who of the team drives, sleeps or is paused, and for how long still (model/leases.h).
//
// This agent's own leases come by LeaseRequest from its own actors (clients' through the gateway), answered with a
// LeaseReply; an error, kInvalid, names the field. They are announced to every other agent's LeaseActor at once, when
// it connects, and again, with a growing delay, until it says that it knows them. Nothing is announced when a lease
// lapses: whoever knows it counts down by himself. Other agents' announcements are checked and speak for their sender
// alone.
//
// Publishes LeasesChanged (Topic::kLeases) at each change and lapse, and answers the ControlRequest `status` with its
// part of AgentStatus. Nothing is stored: a restarted agent neither drives nor sleeps nor is paused until its robot
// says so again, and hears from the others what they do.
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
    proto::TeamConfig team;                                  // Complete and checked.
    Duration announce_after = std::chrono::seconds(5);       // To connected agents that may not know; doubles
    Duration announce_after_max = std::chrono::seconds(60);  // up to this.
  };

  explicit LeaseActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Peer {
    bool is_connected = false;
    bool knows_ours = false;             // It said number_.
    std::optional<std::uint64_t> heard;  // The number of its announcement that counts.
  };

  void OnLocal(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void OnLeaseRequest(Context& context, const proto::LeaseRequest& request);
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnLeaseAnnounce(Context& context, AgentId from, const proto::LeaseAnnounce& announce);

  Result<void> Take(Context& context, const proto::LeaseRequest& request);
  void Announce(Context& context, AgentId to, bool is_reply);
  void AnnounceToUnknowing(Context& context);  // And again after a while.
  void RestartAnnouncing(Context& context);    // With the shortest delay, if somebody connected does not know.
  void OnChange(Context& context);

  const Options options_;
  Leases leases_;
  std::uint64_t number_ = 0;  // Of this agent's own leases.
  std::map<AgentId, Peer> peers_;
  Duration announce_delay_{};
  TimerId announce_timer_ = 0;
  TimerId expiry_timer_ = 0;
  RateLimitedLog refused_log_;
};

}  // namespace moondb
