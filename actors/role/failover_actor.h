// FailoverActor ("failover"): if the team file has `roles.failover: automatic`, the designated survivor takes the lead
// when the leader is lost. With `manual` this actor does nothing.
//
// Only the designated survivor acts. It acts if all these conditions hold without interruption for
// roles.leader_timeout_s:
//   - The leader is not connected.
//   - Neither leader nor survivor may be silent on purpose (sleeping, or driving in radio silence; model/leases.h).
//   - Another agent is connected, if the team has any. A survivor that reaches no agent is itself cut off, and would
//     depose a healthy leader when it reconnects.
// A leader that has not connected since this agent started is not replaced: it may sleep, and only the leader itself
// could have reported that. If leader and survivor fail together, an operator has to decide.
//
// While the two are connected and neither may be silent, the survivor sends a heartbeat (LeaderCheck) to the leader
// three times per leader_timeout_s, and the leader replies. Without heartbeats an idle link is probed only every 30 s.
// With data in flight, the transport drops the connection to a hung leader after 3 s. A hung leader is thus replaced
// after at most 4/3 of leader_timeout_s plus 3 s. The survivor does not evaluate the leader's reply.
//
// To take the lead, this actor sends its agent's RoleActor a RoleSetRequest, as an operator would. It repeats the
// request after another leader_timeout_s if the roles have not changed. RoleActor refuses the request if the roles
// differ from those that this actor knows. The new survivor is a connected rover if there is one, otherwise any rover;
// the lost leader is the last choice.
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
  // Returns whether this agent is the survivor, the leader is connected, and neither may be silent.
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
  std::set<AgentId> known_;  // Agents that have connected, so their leases are known.
  TimerId timer_ = 0;        // Runs while the leader is missed; then TakeLead.
  std::uint64_t count_ = 0;  // Number of timer_; earlier timers that still arrive are ignored.
  TimerId check_timer_ = 0;  // Sends the next heartbeat.
};

}  // namespace moondb
