// RetentionActor ("retention"): removes from this agent's store what need not be kept: now and then what the team
// file's `retention` limits say (actors/retention/retention_plan.h), and at once what an operator orders (PruneOrder,
// answered with a PruneReply).
//
// Before anything goes it asks the RetentionActors of the leader and of the designated survivor, those that are not
// this agent itself, what they have NOW, over the radio (ControlRequest.have: a HaveRequest of its own must not leave
// an agent), and again when a minute has passed; storage then removes only what all of them had and, unless it goes by
// its age, only what one of them still holds: so that size alone never takes the last copy. If one of them cannot be
// reached, is silent, acts on other roles, or there is none, nothing goes, and PruneReply.text says who; nor does
// anything for `roles_held_min` after leader or survivor changed, so that nobody takes a role only to vouch. In turn it
// answers the same question of other agents, from its own storage; while it removes something itself it vouches for
// nothing. What others send is checked here: a have-set that cannot be is an answer that did not come. Which agents
// hold the roles is asked anew each time; an agent that has missed a change asks those who held them before.
//
// Of the history of this agent's own robot (PruneOrder.is_history), which nobody else has, what is ordered goes at
// once.
//
// One thing at a time: an order that comes meanwhile is refused with kFull. After a restart nothing is left to do: each
// request to storage is whole by itself, and StorageActor publishes what it pruned.
//
// Errors in replies: kInvalid (a type that nothing is pruned of), kFull (see there), kUnavailable (no storage, no
// merge), kTimedOut (they are silent), and theirs.
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
    proto::TeamConfig team;                      // Complete and checked.
    Duration period = std::chrono::minutes(10);  // From one look at the limits to the next, at most; half at least.
    Duration peer_timeout = std::chrono::seconds(20);    // For leader and survivor to say what they have.
    Duration vouched_for = std::chrono::minutes(1);      // How long their word holds; then they are asked again.
    Duration roles_held_min = std::chrono::minutes(10);  // How long leader and survivor have to be the same ones.
    Duration own_timeout = std::chrono::seconds(60);     // For this agent's storage and roles,
    Duration merge_timeout = std::chrono::minutes(10);   // and its merging, which may have much to read.
  };

  explicit RetentionActor(Options options) : options_(std::move(options)) {}

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  enum class Stage { kIdle, kStatus, kRoles, kPeers, kOccludedMaps, kPruning };

  // What is under way.
  struct Job {
    std::optional<Address> requester;  // None: the limits.
    std::uint64_t requester_request_id = 0;
    PrunePlan plan;
    std::size_t step = 0;  // Of the plan.
    proto::RoleAssignment roles;
    std::map<AgentId, HaveSet> peers;        // What leader and survivor had, as they said;
    MonotonicTime asked_at;                  // when they were asked.
    std::map<AgentId, std::string> awaited;  // Those who have not answered, as people know them.
    double removed_bytes = 0;
    proto::PruneReply reply;  // As far as it goes.
  };

  // A peer that asked what this agent has.
  struct Asked {
    std::uint64_t request_id = 0;          // Its own,
    std::uint64_t storage_request_id = 0;  // and this one's to storage.
  };

  void OnLocal(Context& context, const proto::Message& message);
  void OnControlReply(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnOrder(Context& context, const proto::Message& message);
  Result<void> CheckOrder(const proto::PruneOrder& order) const;
  void LookLater(Context& context);
  bool SkipsOccludedMaps(Context& context);  // True: the limits go on without.
  bool IsDryRun() const;
  bool IsOfHistory() const;
  void Vouch(Context& context, AgentId peer, std::uint64_t request_id, proto::HaveReply covered);
  void AskRoles(Context& context);
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
  // Sends with the stage's request id; gives up where it is refused.
  void Ask(Context& context, const char* actor, proto::Message message);
  void Begin(Context& context, Job job);
  void DoStep(Context& context);
  void AddPruned(const proto::PruneReply& reply);
  // Nothing can go, and why.
  void Refuse(Context& context, const std::string& text);
  void GiveUp(Context& context, const Error& error);
  void Finish(Context& context);

  const Options options_;
  std::optional<proto::RoleAssignment> roles_;  // As RoleActor published them last;
  std::optional<MonotonicTime> roles_since_;    // none: leader and survivor are those of this actor's start.
  Stage stage_ = Stage::kIdle;
  Job job_;
  std::uint64_t request_id_ = 0;  // Of the stage's questions.
  TimerId stage_timer_ = 0;
  std::map<AgentId, Asked> asked_;  // One of each peer at most: its newest.
  std::string last_refusal_;        // Of the limits, so that it is logged once.
};

}  // namespace moondb
