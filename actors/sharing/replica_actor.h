// ReplicaActor: brings all records that the leader holds to the designated survivor (paper, Section 4), and to a new
// leader all that the team holds.
//
// Nothing is left out but what the receiver's have-set shows: so a lost disk, the survivor's own too, is filled again.
// A ShareRequest{REPLICATION} is the leader's to carry out; with `destination` set any agent replicates to there.
// When the roles change, an unfinished replication turns to the new survivor.
//
// In each term of its own a leader asks every other agent once for all that it holds: what a deposed leader alone had
// collected, what was lost with the leader's disk. It asks one after another, the survivor first, so that nobody sends
// what another has just sent: those that are connected in an open window, and the others when they are. Who brings
// nothing for a while lets the next one go first, and is asked again later and later. Where nothing is missing this
// costs a have-set each.
#pragma once

#include <deque>

#include "actors/sharing/sharing_actor.h"

namespace moondb {

class ReplicaActor final : public SharingActor {
 public:
  explicit ReplicaActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_REPLICATION) {}

 private:
  Result<int> Share(Context& context, const proto::ShareRequest& request, bool is_leaders) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
  void OnPeerEvent(Context& context, AgentId peer) override;
  void OnWindowsChanged(Context& context) override;
  void OnReceived(Context& context, AgentId sender, bool is_all) override;
  void OnOrderRefused(Context& context, AgentId peer) override;
  void OnStepTimer(Context& context, std::uint64_t step) override;
  void AddStatus(const Context& context, proto::ShareStatus& status) const override;

  bool CanBeAsked(const Context& context, AgentId agent) const;
  void BeginGathering(Context& context);
  void AskNext(Context& context);
  void PassOver(Context& context);
  void CrossOff(Context& context, AgentId agent);

  std::deque<AgentId> to_ask_;  // In turn.
  AgentId asked_ = 0;           // Of to_ask_, the one whose turn it is. 0: none of them is connected in an open window.
  MonotonicTime last_progress_{};
  Duration patience_{};     // How long the asked agent may make no progress before the next one's turn.
  std::uint64_t step_ = 0;  // A timer of an earlier one is late.
};

}  // namespace moondb
