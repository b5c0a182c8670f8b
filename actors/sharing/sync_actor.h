// SyncActor: sends this agent's own records to one destination, usually the leader (paper, Section 4).
//
// The effect of a ShareRequest{SYNC} depends on the agent and the sender.
//   From a client at a rover or the base station: the agent sends its own records to the leader or to `destination`.
//   From a client at the leader, with another `destination`: the leader sends that agent the records described below.
//   From a client at the leader, without another destination ("collect"): the leader orders every other agent, or those
//       in from_agents, to send their own records, and repeats the order until each agent answers. The leader also
//       sends each rover the rover's newest optimized poses and edge verdicts and the records that the policy `rovers`
//       asks for, and the base station those that the policy `ground` asks for. Records that an agent brings in go on
//       to the others when all agents have sent theirs, or 1 s after the first agent. Rovers and base station also get
//       back own records that they have lost. If a leader in a new term gathers records meanwhile (replica_actor.h),
//       the order is complete only after these records are sent too.
//   From a peer: the agent sends its own records to `destination`, or to the peer.
//
// If the team file sets radio.sync_period_s, records flow without orders (flow_schedule.h): each agent sends the leader
// its new records, and the leader sends the other agents the records described above. The survivor gets them from
// ReplicaActor.
//
// If the team file sets radio.states_period_s, each agent that is connected to the leader sends the leader its latest
// states with that period, without an order.
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "actors/sharing/sharing_actor.h"

namespace moondb {

// Returns the filter for the records of all origins that the team file's `ground` asks for. The leader sends these
// records to the base station, and bundles contain them. The filter has no data types if `ground` asks for no records.
// Do not pass such a filter to StorageActor, for which an empty list means "all types".
proto::RecordFilter GroundRecords(const proto::TeamConfig& team);

class SyncActor final : public SharingActor {
 public:
  explicit SyncActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_SYNC) {}

 private:
  Result<int> Share(Context& context, const proto::ShareRequest& request, bool is_leaders) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
  void OnReceived(Context& context, AgentId sender, const Received& received) override;
  void OnPeerEvent(Context& context, AgentId peer) override;
  bool IsToOpenAgain(std::uint64_t order) const override {
    return order == collecting_order_ && is_bring_timer_running_;
  }
  void OnGathering(Context& context, const proto::Gathering& gathering) override;
  std::optional<std::vector<AgentId>> YetToGather() const override;
  void OnStored(const proto::RecordsStored& stored) override;
  proto::RecordFilter FlowRecordsFor(AgentId destination) const override;
  void OnStarted(Context& context) override;
  void OnStepTimer(Context& context, std::uint64_t step) override;

  int Collect(Context& context, const proto::ShareRequest& request);
  // Returns whether the leader sends a destination the records of this type of all origins.
  bool IsForAll(AgentId destination, DataType type) const;
  // Sends records that agents have brought in on to those that may lack them.
  void Forward(Context& context);
  void ForwardSoon(Context& context);
  void OpenAsLeader(Context& context, AgentId destination, bool is_by_role, std::uint64_t bytes_max = 0);
  void StartStatesTimer(Context& context);
  void SetFlow(const Context& context);

  proto::RecordFilter OwnRecords() const;
  proto::RecordFilter LeadersRecordsFor(AgentId destination) const;

  bool is_bringing_on_ = false;  // The last "collect" order also sends on the records that agents bring in.
  std::set<AgentId> lacking_;    // Agents that may lack such records.
  bool is_bring_timer_running_ = false;
  // Number of the last "collect" order that also sends records of this agent; 0: none.
  std::uint64_t collecting_order_ = 0;
  std::optional<proto::Gathering> gathering_;  // The last report of ReplicaActor.
};

}  // namespace moondb
