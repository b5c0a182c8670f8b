// FailoverActor ("failover"): with `roles.failover: automatic` in the team file, the designated survivor takes the lead
// when the leader is lost. With `manual` it does nothing.
//
// Only the designated survivor acts, and only when for roles.leader_timeout_s without a break
//   - the leader was not connected (a link that lives is heard of every 30 s, however idle);
//   - the window between the two was open (model/leases.h): a leader that sleeps or drives is silent on purpose;
//   - some other agent was connected, if the team has any: a survivor that reaches nobody is itself the lost one, and
//     would depose a leader that is well when it comes back.
// A leader that was never connected since this agent started is not missed: only from itself could this agent know
// whether it sleeps. Where leader and survivor go down together an operator has to decide.
//
// It asks this agent's RoleActor by a RoleSetRequest, as an operator would, and asks again after another timeout if
// nothing came of it. The new survivor is a rover that is connected, else any, the lost leader last.
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
  void OnTimer(Context& context, std::uint64_t count);

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
};

}  // namespace moondb
