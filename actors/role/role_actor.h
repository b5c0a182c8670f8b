// RoleActor ("role"): holds this agent's role assignment and agrees on it with the other agents (RoleLogic).
//
// Stores an assignment through StorageActor before it acts on the assignment. The actor then calls Context::SetRoles,
// publishes RolesChanged (Topic::kRoles), and sends RoleAnnounce to the RoleActors of the other agents. If an
// assignment cannot be stored, the agent gives up its role at once (RoleLogic).
//
// Answers RoleShowRequest and RoleSetRequest with a RoleShowReply, or with a ControlReply that holds only an error. A
// RoleSetRequest with wait_s is answered once the new leader and survivor act on the new assignment, or after wait_s.
// If another assignment replaces the new one first, the reply is kRefused. Requests of clients arrive through the
// gateway; other agents may send only RoleAnnounce, RoleChainRequest and RoleChainReply.
//
// On StepDown (an actor of this agent fails repeatedly), the actor hands its agent's role to a connected agent. If no
// suitable agent is connected, the actor waits until one connects.
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
    Duration storage_timeout = std::chrono::seconds(5);  // Time until an unanswered request is repeated.
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
  void RequestStorage(Context& context);  // Sends a LoadRolesRequest; once loaded, a SaveRolesRequest for saving().
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
  std::map<AgentId, double> refused_announcements_;  // Number of refused announcements, by sender.
  RecordReader assignments_;
  RateLimitedLog refused_log_;
  RateLimitedLog unstored_log_;
  std::optional<Requester> requester_;
  std::vector<Waiting> waiting_;
  std::set<AgentId> connected_;
  std::optional<std::string> step_down_reason_;  // Set while the agent wants to give up its role.
};

}  // namespace moondb
