// FailoverActor ("failover"): with `roles.failover: automatic` in the team file, the designated survivor takes the lead
// when the leader is lost. With `manual` it does nothing.
//
// Only the designated survivor acts, and only when for roles.leader_timeout_s without a break
//   - the leader was not connected;
//   - the window between the two was open (model/leases.h): a leader that sleeps or drives is silent on purpose;
//   - some other agent was connected, if the team has any: a survivor that reaches nobody is itself the lost one, and
//     would depose a leader that is well when it comes back.
// A leader that was never connected since this agent started is not missed: only from itself could this agent know
// whether it sleeps. Where leader and survivor go down together an operator has to decide.
//
// While the two are connected and their window is open, the survivor asks the leader each third of that time whether it
// is there (LeaderCheck), and the leader answers. Without that an idle link is asked every 30 s only; with something
// under way the transport gives a leader that hangs up after 3 s. So such a leader is replaced after 4/3 of
// leader_timeout_s and 3 s at most. An answer by itself decides nothing.
//
// It asks this agent's RoleActor by a RoleSetRequest, as an operator would, and asks again after another timeout if
// nothing came of it; it is refused where RoleActor holds other roles than this actor has heard of. The new survivor is
// a rover that is connected, else any, the lost leader last.
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
    proto::TeamConfig team;  // Complete and checked.
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
  // Leader and survivor may talk now.
  bool MayAskLeader(const Context& context) const;
  bool IsLeaderMissed(Context& context) const;
  bool ReachesAnyOther() const;
  AgentId NextSurvivor() const;   // 0: the team has no other rover.
  void Review(Context& context);  // Starts to count, goes on, or stops.
  void StopCounting(Context& context);

  const Options options_;
  const Duration leader_timeout_;
  proto::RoleAssignment roles_;  // Until RoleActor speaks, those of the team file.
  Leases leases_;
  std::set<AgentId> connected_;
  std::set<AgentId> known_;  // Whose leases this agent knows, as far as they were announced to it.
  TimerId timer_ = 0;        // Runs while the leader is missed.
  std::uint64_t count_ = 0;  // A timer of an earlier count is late.
  TimerId check_timer_ = 0;  // Runs while this agent is the survivor.
};

}  // namespace moondb
