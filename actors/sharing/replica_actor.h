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
// costs a have-set each. SyncActor hears whom it has yet to ask. An order of a client is done when what was gathered
// meanwhile is with the survivor, too.
#pragma once

#include <deque>
#include <map>
#include <set>

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
  void OnGathering(Context& context, const proto::Gathering& question) override;
  void OnOrderRefused(Context& context, AgentId peer) override;
  void OnStepTimer(Context& context, std::uint64_t step) override;
  void AddStatus(const Context& context, proto::ShareStatus& status) const override;

  std::optional<std::vector<AgentId>> YetToGather() const override;
  void NotifySyncActor(Context& context);
  bool CanBeAsked(const Context& context, AgentId agent) const;
  void BeginGathering(Context& context);
  void AskNext(Context& context);
  void PassOver(Context& context);
  void CrossOff(Context& context, AgentId agent);

  std::deque<AgentId> to_ask_;                         // In turn.
  std::set<AgentId> refused_;                          // They do not share in this term: nobody asks them again.
  std::map<AgentId, std::uint64_t> orders_to_gather_;  // By whom they go to, in this term.
  std::uint64_t order_to_bring_on_ = 0;                // Of a client, to replicate to the survivor in this term.
  AgentId asked_ = 0;  // Of to_ask_, the one whose turn it is. 0: none of them is connected in an open window.
  MonotonicTime last_progress_{};
  Duration patience_{};           // How long the asked agent may make no progress before the next one's turn.
  std::uint64_t step_ = 0;        // A timer of an earlier one is late.
  bool is_sync_notified_ = true;  // SyncActor's mailbox had room for whom is yet to be asked.
};

}  // namespace moondb
