// ReplicaActor: replicates all records of the leader to the designated survivor (paper, Section 4), and gathers all
// records of the team at a new leader.
//
// Only the leader carries out a ShareRequest{REPLICATION} without `destination`. With `destination`, any agent
// replicates its records to that destination. When the roles change, an unfinished replication continues to the new
// survivor. An agent whose disk was lost gets all records again, since replication skips only records that the agent's
// have-set covers.
//
// In each of its terms a leader gathers: it asks every other agent once for all records that the agent holds. This
// recovers records that only a deposed leader had collected, or that were lost with the leader's disk. The leader asks
// one agent after another, the survivor first, so no two agents send the same records. An agent is asked only while it
// is connected and the window to it is open (IsWindowOpen). If the asked agent makes no progress for some time
// (patience_), the leader asks the next agent, and asks this agent again later.
//
// If the team file sets radio.sync_period_s, the leader also replicates new records without an order (flow_schedule.h).
//
// ReplicaActor notifies SyncActor which agents are still to be asked. A client's order without a byte limit is complete
// only when the records that were gathered meanwhile have reached the survivor.
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
  void OnReceived(Context& context, AgentId sender, const Received& received) override;
  void OnGathering(Context& context, const proto::Gathering& question) override;
  void OnOrderRefused(Context& context, AgentId peer) override;
  void OnStepTimer(Context& context, std::uint64_t step) override;
  void OnStarted(Context& context) override { SetFlow(context); }
  void OnStored(const proto::RecordsStored& stored) override;
  proto::RecordFilter FlowRecordsFor(AgentId) const override { return {}; }
  void AddStatus(const Context& context, proto::ShareStatus& status) const override;

  std::optional<std::vector<AgentId>> YetToGather() const override;
  void SetFlow(const Context& context);
  void NotifySyncActor(Context& context);
  bool CanBeAsked(const Context& context, AgentId agent) const;
  void BeginGathering(Context& context);
  void RequestNext(Context& context);
  void PassOver(Context& context);
  void CrossOff(Context& context, AgentId agent);

  std::deque<AgentId> to_ask_;  // Agents to gather from, in the order in which they are asked.
  // Agents that refused to share, or whose records this agent refused. Not asked again in this term.
  std::set<AgentId> refused_;
  std::map<AgentId, std::uint64_t> orders_to_gather_;  // This term's order number for each agent that was asked.
  // Number of a client's order in this term to replicate to the survivor; 0: none.
  std::uint64_t order_to_bring_on_ = 0;
  // The agent of to_ask_ that is being asked. 0: none of these agents is connected with an open window.
  AgentId asked_ = 0;
  MonotonicTime last_progress_{};
  Duration patience_{};           // If the asked agent makes no progress for this time, the next agent is asked.
  std::uint64_t step_ = 0;        // Counts the calls of RequestNext. A timer with an earlier count is ignored.
  bool is_sync_notified_ = true;  // False if the last notification did not fit into SyncActor's mailbox.
};

}  // namespace moondb
