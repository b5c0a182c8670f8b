// RetentionActor ("retention"): prunes this agent's store, periodically by the `retention` limits of the team file
// (actors/retention/retention_plan.h), and on request by an operator's PruneOrder. The reply to an order is a
// PruneReply.
//
// Before a prune, the actor requests the have-sets of the leader and of the designated survivor from their
// RetentionActors. If this agent has one of these roles, it asks only the other agent. Storage then removes only
// records that the requested have-sets cover. Unless the limit is an age, an asked agent must still hold the record, so
// a size limit never removes the last copy. An order to prune this agent's history (PruneOrder.is_history) asks no
// agent, because no other agent has a copy.
//
// Nothing is removed if the leader or the survivor is not assigned, cannot be reached, does not answer, acts on other
// roles, or sends a malformed have-set. Nothing is removed either for `roles_held_min` after the leader or the survivor
// changed. An agent thus cannot take a role only to confirm a prune. PruneReply.text gives the reason.
//
// The actor also answers other agents' requests for this agent's have-set. While this agent prunes, the answer is an
// empty have-set.
//
// A prune that removed records because of their age is logged as an event, with the number of records of each type.
//
// One prune runs at a time. Each request to storage is atomic, so a restart leaves no step half done.
//
// Errors in replies:
// - kInvalid: the order names a data type that is never pruned;
// - kFull: a prune is running;
// - kUnavailable: the storage, role or merge actor does not accept a request;
// - kTimedOut: one of these actors did not answer;
// - any error of these actors.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "actors/retention/retention_plan.h"
#include "model/have_set.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

class RetentionActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Requires: complete and validated.
    // Upper bound of the random time between two checks of the limits; the lower bound is half of this value.
    Duration period = std::chrono::minutes(10);
    // Timeout for the have-sets of leader and survivor.
    Duration peer_timeout = std::chrono::seconds(20);
    // Have-sets of leader and survivor that are older than this are requested again.
    Duration vouched_for = std::chrono::minutes(1);
    // Pruning is refused until leader and survivor have been unchanged for this long.
    Duration roles_held_min = std::chrono::minutes(10);
    // Timeout for this agent's storage and role actors.
    Duration own_timeout = std::chrono::seconds(60);
    // Timeout for this agent's merge actor, which may have to read many maps.
    Duration merge_timeout = std::chrono::minutes(10);
  };

  explicit RetentionActor(Options options) : options_(std::move(options)) {}

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  enum class Stage { kIdle, kStatus, kRoles, kPeers, kOccludedMaps, kPruning };

  // The prune in progress.
  struct Job {
    std::optional<Address> requester;  // Null if the limits of the team file are applied.
    std::uint64_t requester_request_id = 0;
    PrunePlan plan;
    std::size_t step = 0;  // Index into `plan`.
    proto::RoleAssignment roles;
    std::map<AgentId, HaveSet> peers;        // Have-sets that leader and survivor reported.
    MonotonicTime asked_at;                  // When the have-sets of the peers were requested.
    std::map<AgentId, std::string> awaited;  // Peers that have not answered, with their names and roles for messages.
    double removed_bytes = 0;
    std::map<DataType, double> aged;  // Number of records removed because of their age, by type.
    proto::PruneReply reply;          // Reply for the steps that have been executed.
  };

  // A request of a peer for this agent's have-set.
  struct Asked {
    std::uint64_t request_id = 0;          // Id of the peer's request.
    std::uint64_t storage_request_id = 0;  // Id of the request to this agent's storage.
  };

  void OnLocal(Context& context, const proto::Message& message);
  void OnControlReply(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnOrder(Context& context, const proto::Message& message);
  Result<void> CheckOrder(const proto::PruneOrder& order) const;
  void InspectLater(Context& context);
  // Called when MergeActor fails. If the prune applies the team file's limits, skips the fully occluded maps and
  // returns true. If an operator ordered the prune, returns false.
  bool SkipsOccludedMaps(Context& context);
  bool IsDryRun() const;
  bool IsOfHistory() const;
  void Vouch(Context& context, AgentId peer, std::uint64_t request_id, proto::HaveReply covered);
  void RequestRoles(Context& context);
  void OnPeersQuestion(Context& context, AgentId peer, std::uint64_t request_id);
  void OnOwnHave(Context& context, const proto::Message& message);
  void OnPeersHave(Context& context, AgentId peer, const proto::HaveReply& covered);
  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnRolesChanged(const Context& context, const proto::RoleAssignment& roles);
  void OnPruned(Context& context, const proto::PruneReply& reply);

  bool IsAnswer(const proto::Message& message, Stage stage) const {
    return stage_ == stage && message.request_id() == request_id_;
  }
  void Enter(Context& context, Stage stage, Duration timeout);
  // Sends `message`, with request_id_ as its request id, to the actor of this agent whose name is `actor`. Ends the job
  // with kUnavailable if the message cannot be sent.
  void Ask(Context& context, const char* actor, proto::Message message);
  void Begin(Context& context, Job job);
  void DoStep(Context& context);
  void AddPruned(const proto::PruneReply& reply);
  // Logs an event that names what the job removed because of its age.
  void LogAged(Context& context);
  // Ends the job without an error. `text`: the reason why nothing can be removed.
  void Refuse(Context& context, const std::string& text);
  void GiveUp(Context& context, const Error& error);
  void Finish(Context& context);

  const Options options_;
  std::optional<proto::RoleAssignment> roles_;  // The assignment that RoleActor published last.
  // Time at which the leader or survivor last changed; null if neither changed since this actor started.
  std::optional<MonotonicTime> roles_since_;
  Stage stage_ = Stage::kIdle;
  Job job_;
  std::uint64_t request_id_ = 0;  // Id of the current stage's requests.
  TimerId stage_timer_ = 0;
  std::map<AgentId, Asked> asked_;  // The newest open request of each peer for this agent's have-set.
  // Reason why the limits were not applied last time. The same reason is not logged twice in a row.
  std::string last_refusal_;
};

}  // namespace moondb
