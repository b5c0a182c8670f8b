// SyncActor: brings this agent's own records to one destination, usually @leader (paper, Section 4).
//
// What a ShareRequest{SYNC} means:
//   on a rover or the base station   a session of its own records to the leader, or to `destination`.
//   on the leader, without another destination   "collect": the same order goes to every other agent (or to
//       from_agents), again and again until each answers; and the leader brings each rover its newest optimized
//       poses and edge verdicts, and the base station what the policy `ground` asks for, again as each agent's
//       records have come in. Both get home what they shared themselves and have lost. What a leader in a new term
//       gathers meanwhile (replica_actor.h) belongs to the order: it is brought on before the order is done.
// From another agent it always means: your own records to `destination`, or to who asks.
//
// With the team file's radio.states_period_s each agent that is connected to the leader sends it its latest states
// unasked, so often.
#pragma once

#include "actors/sharing/sharing_actor.h"

namespace moondb {

// What the team file's `ground` asks for, of all origins: what the leader brings the base station, and what goes into
// bundles. Without data types where it asks for nothing: to StorageActor that would mean all.
proto::RecordFilter GroundRecords(const proto::TeamConfig& team);

class SyncActor final : public SharingActor {
 public:
  explicit SyncActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_SYNC) {}

 private:
  Result<int> Share(Context& context, const proto::ShareRequest& request, bool is_leaders) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
  void OnReceived(Context& context, AgentId sender, bool is_all) override;
  void OnGathering(Context& context, const proto::Gathering& gathering) override;
  std::optional<std::vector<AgentId>> YetToGather() const override;
  void OnStarted(Context& context) override;
  void OnStepTimer(Context& context, std::uint64_t step) override;

  int Collect(Context& context, const proto::ShareRequest& request);
  void OpenAsLeader(Context& context, AgentId destination, bool is_by_role, std::uint64_t bytes_max = 0);
  void StartStatesTimer(Context& context);

  proto::RecordFilter OwnRecords() const;
  proto::RecordFilter LeadersRecordsFor(AgentId destination) const;

  bool is_bringing_to_base_ = false;           // Since the last order to collect.
  std::uint64_t collecting_order_ = 0;         // The last order to collect that brings records from here, too.
  std::optional<proto::Gathering> gathering_;  // As ReplicaActor said last.
};

}  // namespace moondb
