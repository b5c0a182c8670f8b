// SyncActor: brings this agent's own records to one destination, usually @leader (paper, Section 4).
//
// What a ShareRequest{SYNC} means:
//   on a rover or the base station   a session of its own records to the leader, or to `destination`.
//   on the leader, without another destination   "collect": the same order goes to every other agent (or to
//       from_agents), again and again until each answers; and the leader brings each rover its newest optimized
//       poses and edge verdicts, and the base station what the policy `ground` asks for, again as each agent's
//       records have come in.
// From another agent it always means: your own records to `destination`, or to who asks.
#pragma once

#include <map>

#include "actors/sharing/sharing_actor.h"

namespace moondb {

class SyncActor final : public SharingActor {
 public:
  explicit SyncActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_SYNC) {}

 private:
  // "Share with me", to an agent that has not answered yet.
  struct Order {
    Duration delay{};
    TimerId timer = 0;
  };

  Result<int> Share(Context& context, const proto::ShareRequest& request) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
  void OnShareReply(Context& context, AgentId peer, const proto::ShareReply& reply) override;
  void OnPeerConnected(Context& context, AgentId peer) override;
  void OnOrderTimer(Context& context, AgentId peer) override;
  void OnReceivedAll(Context& context, AgentId sender) override;

  int Collect(Context& context, const proto::ShareRequest& request);
  bool OpenAsLeader(Context& context, AgentId destination, bool is_by_role);
  void SendOrder(Context& context, AgentId peer);
  void StartOrder(Context& context, AgentId peer);

  proto::RecordFilter OwnRecords() const;
  // No data types: nothing is to be shared.
  proto::RecordFilter LeadersRecordsFor(AgentId destination) const;

  std::map<AgentId, Order> orders_;
  bool is_bringing_to_base_ = false;  // Since the last order to collect.
};

}  // namespace moondb
