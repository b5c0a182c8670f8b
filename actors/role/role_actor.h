// RoleActor ("role"): holds this agent's role assignment and agrees on it with the other agents (RoleLogic).
//
// Stores an assignment through StorageActor before it acts (one that cannot be stored makes it give up its role at
// once, as RoleLogic says): Context::SetRoles, RolesChanged published (Topic::kRoles), RoleAnnounce to the other
// agents' RoleActors. Answers RoleShowRequest and RoleSetRequest with RoleShowReply, or with a ControlReply that holds
// nothing but an error; a RoleSetRequest with wait_s when the new leader and survivor act on it, kRefused where another
// assignment takes its place before. The ControlRequest `status` with its part of AgentStatus. All are taken from this
// agent's own actors only, as clients come through the gateway. After a restart everything comes back from storage.
//
// In a team with keys it answers the other agents' RoleChainRequests, and reads the assignments that are stored as
// records (role_assignment), so that it knows what counts though it was away.
//
// On StepDown (an actor of this agent fails again and again) it gives up the agent's role to an agent that is
// connected, now or as soon as there is one.
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
    proto::TeamConfig team;  // Complete and checked.
    // Signs with this agent's own key (runtime/team/role_signature.h); null in a team without keys.
    std::function<std::string(const proto::RoleAssignment&)> sign;
    Duration leader_wait = std::chrono::seconds(2);
    Duration announce_after = std::chrono::seconds(5);
    Duration announce_after_max = std::chrono::seconds(60);
    Duration storage_timeout = std::chrono::seconds(5);  // Then storage is asked again.
  };

  explicit RoleActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  // Who asked for the change that is being stored.
  struct Requester {
    Address address;
    std::uint64_t request_id = 0;
    Duration wait{};
  };

  // A request that waits until the assignment is acted on.
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
  void AskStorage(Context& context);  // To load at first, then to save what is to be stored.
  void AnswerRequester(Context& context, std::optional<Error> error);
  void Answer(Context& context, const Requester& requester, const Result<proto::RoleShowReply>& reply);
  void AnswerWhoWaits(Context& context);
  // Nothing while there is a reason to wait.
  std::optional<Result<proto::RoleShowReply>> AnswerTo(const Waiting& waiting, MonotonicTime now) const;

  Options options_;
  RoleLogic logic_;
  std::uint64_t storage_request_id_ = 0;
  TimerId storage_timer_ = 0;
  TimerId store_timer_ = 0;
  TimerId announce_timer_ = 0;
  std::map<AgentId, double> refused_announcements_;  // By who sent them.
  RecordReader assignments_;
  RateLimitedLog refused_log_;
  RateLimitedLog unstored_log_;
  std::optional<Requester> requester_;
  std::vector<Waiting> waiting_;
  std::set<AgentId> connected_;
  std::optional<std::string> step_down_reason_;  // Until the role is given up.
};

}  // namespace moondb
