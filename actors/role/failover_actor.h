// FailoverActor ("failover"): if the team file has `roles.failover: automatic`, the designated survivor takes the lead
// when the leader is lost. With `manual` this actor does nothing.
//
// The survivor acts if all these conditions hold without interruption for roles.leader_timeout_s:
//   - The leader is not connected. A leader that has not been connected since this agent started does not count as
//     lost, unless it has left the team.
//   - Neither leader nor survivor may be silent on purpose (sleeping, or driving in radio silence; model/leases.h).
//   - Another agent is connected, if the team has any. A survivor that reaches no agent is itself cut off, and would
//     depose a healthy leader when it reconnects.
//
// While the leader is connected and neither of the two may be silent, the survivor sends the leader a heartbeat
// (LeaderCheck) three times per leader_timeout_s. With a heartbeat in flight, the transport drops the connection to a
// hung leader after 3 s, and otherwise only after more than 30 s.
//
// To take the lead, this actor sends RoleActor a RoleSetRequest, and repeats the request after another leader_timeout_s
// if the roles have not changed. The new survivor is a connected rover if there is one, otherwise any rover. The lost
// leader is the last choice.
#pragma once

#include <set>

#include "model/leases.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

class FailoverActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Requires: complete and validated.
  };

  explicit FailoverActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnPeerEvent(const proto::PeerEvent& event);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnLeaderCheck(Context& context, const proto::LeaderCheck& check);

  void TakeLead(Context& context);
  bool IsAutomatic() const { return options_.team.roles().failover() == proto::FAILOVER_AUTOMATIC; }
  // Returns true if this agent is the survivor, the leader is connected, and neither may be silent.
  bool MayAskLeader(const Context& context) const;
  bool IsLeaderMissed(Context& context) const;
  bool ReachesAnyOther() const;
  AgentId NextSurvivor() const;   // Returns 0 if the team has no other rover.
  void Review(Context& context);  // Starts or stops the timeout, depending on IsLeaderMissed.
  void StopCounting(Context& context);

  const Options options_;
  const Duration leader_timeout_;
  proto::RoleAssignment roles_;  // The team file's roles until RoleActor publishes others.
  Leases leases_;
  std::set<AgentId> connected_;
  std::set<AgentId> known_;  // Agents whose leases are known, because they have connected.
  TimerId timer_ = 0;        // Runs while the leader is missed. At its end, OnTimer takes the lead.
  std::uint64_t count_ = 0;  // Rises at each start and stop of timer_. OnTimer ignores timers with an older value.
  TimerId check_timer_ = 0;  // Timer of the next heartbeat.
};

}  // namespace moondb
