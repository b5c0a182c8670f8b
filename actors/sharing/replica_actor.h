// ReplicaActor: brings all records that the leader holds to the designated survivor (paper, Section 4), and to a new
// leader all that the team holds.
//
// Nothing is left out but what the receiver's have-set shows: so a lost disk, the survivor's own too, is filled again.
// A ShareRequest{REPLICATION} is the leader's to carry out; with `destination` set any agent replicates to there.
// When the roles change, an unfinished replication turns to the new survivor.
//
// In each term of its own a leader asks every other agent once for all that it holds: what a deposed leader alone had
// collected, what was lost with the leader's disk. It asks one after another, the survivor first, so that nobody sends
// what another has just sent; who does not answer is asked again when the others are through or it is reached again.
// Where nothing is missing this costs a have-set each.
#pragma once

#include <deque>

#include "actors/sharing/sharing_actor.h"

namespace moondb {

class ReplicaActor final : public SharingActor {
 public:
  explicit ReplicaActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_REPLICATION) {}

 private:
  Result<int> Share(Context& context, const proto::ShareRequest& request) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
  void OnPeerConnected(Context& context, AgentId peer) override;
  void OnReceivedAll(Context& context, AgentId sender) override;
  void OnStepTimer(Context& context) override;

  void BeginGathering(Context& context);
  void AskNext(Context& context);

  std::deque<AgentId> to_ask_;  // The first one is being asked.
  TimerId step_timer_ = 0;      // Runs while it has not given all. 0: nobody is being asked.
};

}  // namespace moondb
