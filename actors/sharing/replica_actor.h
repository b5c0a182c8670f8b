// ReplicaActor: replicates all records of the leader to the designated survivor (paper, Section 4), and gathers all
// records of the team at a new leader.
//
// Replication skips only records that the receiver's have-set covers. An agent whose disk was lost, even the survivor,
// thus gets all records again. Only the leader carries out a ShareRequest{REPLICATION} without `destination`. With
// `destination`, any agent replicates its records to that destination. When the roles change, an unfinished replication
// continues to the new survivor.
//
// In each of its terms a leader asks every other agent once for all records that it holds. This recovers records that
// only a deposed leader had collected, or that were lost with the leader's disk. The leader asks one agent after
// another, the survivor first, so no two agents send the same records. An agent is asked when it is connected and no
// lease shuts the window to it. If the asked agent makes no progress, the leader asks the next one; the time that it
// waits doubles with each such turn. If no records are missing, gathering costs one have-set per agent. ReplicaActor
// notifies SyncActor which agents are still to be asked. A client's order is complete only when the records gathered
// meanwhile have reached the survivor.
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

  std::deque<AgentId> to_ask_;                         // Agents to gather from, in the order of their turns.
  std::set<AgentId> refused_;                          // Agents that refused to share; not asked again in this term.
  std::map<AgentId, std::uint64_t> orders_to_gather_;  // Order numbers of this term, by the agent that is asked.
  // Number of a client's order in this term to replicate to the survivor; 0: none.
  std::uint64_t order_to_bring_on_ = 0;
  // The agent of to_ask_ that is being asked. 0: none of these agents is connected with an open window.
  AgentId asked_ = 0;
  MonotonicTime last_progress_{};
  Duration patience_{};           // How long the asked agent may make no progress before the next agent's turn.
  std::uint64_t step_ = 0;        // Number of the current turn. A timer with an earlier number is ignored.
  bool is_sync_notified_ = true;  // SyncActor was notified of the agents to ask; false if its mailbox was full.
};

}  // namespace moondb
