// RoleActor ("role"): holds this agent's role assignment and agrees on it with the other agents (RoleLogic).
//
// Stores an assignment through StorageActor before it acts on the assignment. To act means to call Context::SetRoles,
// to publish RolesChanged (Topic::kRoles), and to send RoleAnnounce to the RoleActors of the other agents. If an
// assignment cannot be stored, the agent gives up its role at once (RoleLogic).
//
// Answers RoleShowRequest and RoleSetRequest with a RoleShowReply, or with a ControlReply that holds only an error. A
// RoleSetRequest with wait_s is answered when the new leader and survivor act on the new assignment, or with kRefused
// if another assignment replaces it before. Answers the ControlRequest `status` with its part of AgentStatus. Accepts
// requests only from this agent's own actors; requests of clients arrive through the gateway. After a restart, all
// state is loaded from storage.
//
// In a team with keys, the actor also answers RoleChainRequests of other agents. It reads the assignments stored as
// records (role_assignment), so it learns of decisions made while it was offline.
//
// On StepDown (an actor of this agent fails repeatedly), it hands the agent's role to a connected agent. If no agent is
// connected, it waits until one connects.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/role/role_logic.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"
#include "runtime/record_reader.h"

namespace moondb {

class RoleActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Requires: complete and validated.
    // Signs with this agent's own key (runtime/team/role_signature.h). Null in a team without keys.
    std::function<std::string(const proto::RoleAssignment&)> sign;
    Duration leader_wait = std::chrono::seconds(2);
    Duration announce_after = std::chrono::seconds(5);
    Duration announce_after_max = std::chrono::seconds(60);
    Duration storage_timeout = std::chrono::seconds(5);  // Then the unanswered request is repeated.
  };

  explicit RoleActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  // The sender of the RoleSetRequest whose assignment is being stored.
  struct Requester {
    Address address;
    std::uint64_t request_id = 0;
    Duration wait{};
  };

  // A request whose reply waits until the new leader and survivor act on the assignment.
  struct Waiting {
    Requester requester;
    proto::RoleAssignment roles;
    MonotonicTime until{};
  };
  static constexpr std::size_t kWaitingMax = 16;

  void OnAnyMessage(Context& context, const proto::Message& message);
  void OnLocal(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void OnLoadRolesReply(Context& context, const proto::LoadRolesReply& reply);
  void OnSaveRolesReply(Context& context, const proto::Message& message);
  void OnRoleSetRequest(Context& context, const proto::Message& message);
  void OnRoleShowRequest(Context& context, const proto::RoleShowRequest& request);
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnRoleAnnounce(Context& context, AgentId from, const proto::RoleAnnounce& announce);
  void OnRoleChainRequest(Context& context, const proto::RoleChainRequest& request);
  Result<void> OnRecord(Context& context, const proto::StoredRecord& record);
  void PerformOr(Context& context, AgentId from, Result<RoleLogic::Actions> actions);

  Result<proto::RoleShowReply> Show(bool with_history) const;
  void StepDownIfDue(Context& context);
  void Perform(Context& context, RoleLogic::Actions actions);
  void Apply(Context& context, const proto::RoleAssignment& roles);
  void AskStorage(Context& context);  // Asks to load the roles; once loaded, to save logic_.saving().
  void AnswerRequester(Context& context, std::optional<Error> error);
  void Answer(Context& context, const Requester& requester, const Result<proto::RoleShowReply>& reply);
  void AnswerWhoWaits(Context& context);
  // Returns the reply to a waiting request; nullopt while the request has to wait longer.
  std::optional<Result<proto::RoleShowReply>> AnswerTo(const Waiting& waiting, MonotonicTime now) const;

  Options options_;
  RoleLogic logic_;
  std::uint64_t storage_request_id_ = 0;
  TimerId storage_timer_ = 0;
  TimerId store_timer_ = 0;
  TimerId announce_timer_ = 0;
  std::map<AgentId, double> refused_announcements_;  // Counts by sender.
  RecordReader assignments_;
  RateLimitedLog refused_log_;
  RateLimitedLog unstored_log_;
  std::optional<Requester> requester_;
  std::vector<Waiting> waiting_;
  std::set<AgentId> connected_;
  std::optional<std::string> step_down_reason_;  // Set while the agent wants to give up its role.
};

}  // namespace moondb
