#include "actors/role/role_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <ratio>
#include <utility>

#include "model/agent_name.h"
#include "model/command_from.h"
#include "model/control_message.h"
#include "model/control_request.h"
#include "model/role_confirmation.h"
#include "model/term.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kStorage = 1, kAnnounce = 2, kLeader = 3, kStore = 4, kWaitIsOver = 5 };

proto::Message MessageOf(const Result<proto::RoleShowReply>& shown) {
  if (!shown) return ErrorMessage(shown.error());
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_role_show_reply() = *shown;
  return message;
}

RoleLogic::Options LogicOptions(const RoleActor::Options& options) {
  RoleLogic::Options logic;
  logic.self = options.self;
  for (const proto::AgentConfig& agent : options.team.agents()) {
    logic.agents.push_back(agent.id());
    if (agent.left()) logic.left.insert(agent.id());
  }
  logic.initial = InitialRoles(options.team);
  logic.check = [team = options.team](const proto::RoleAssignment& roles) { return CheckRoles(team, roles); };
  logic.may_command = [team = options.team](AgentId agent) { return MayCommand(team, agent); };
  if (options.sign) {
    logic.sign = options.sign;
    logic.is_signed = [team = options.team](const proto::RoleAssignment& roles) { return IsSigned(team, roles); };
  }
  logic.name_of = [team = options.team](AgentId agent) { return AgentName(team, agent); };
  logic.leader_wait = options.leader_wait;
  logic.announce_after = options.announce_after;
  logic.announce_after_max = options.announce_after_max;
  return logic;
}

}  // namespace

RoleActor::RoleActor(Options options)
    : options_(std::move(options)),
      logic_(LogicOptions(options_)),
      assignments_({.data_types = {proto::ROLE_ASSIGNMENT}},
                   [this](Context& context, const proto::StoredRecord& record) { return OnRecord(context, record); }) {}

void RoleActor::OnStart(Context& context) {
  // Start at a random id. Otherwise a late reply to a request from before a restart could match a new request.
  storage_request_id_ = context.rng()();
  context.WatchPeers();
  RequestStorage(context);
}

void RoleActor::OnMessage(Context& context, const proto::Message& message) {
  logic_.SetNow(context.now());
  OnAnyMessage(context, message);
  AnswerWhoWaits(context);
}

void RoleActor::OnAnyMessage(Context& context, const proto::Message& message) {
  if (assignments_.OnMessage(context, message)) return;
  const AgentId from = context.sender().agent;
  if (from == options_.self) {
    OnLocal(context, message);
  } else if (message.has_role_announce()) {
    OnRoleAnnounce(context, from, message.role_announce());
  } else if (message.has_role_chain_request()) {
    OnRoleChainRequest(context, message.role_chain_request());
  } else if (message.has_role_chain_reply()) {
    PerformOr(context, from, logic_.OnChainReply(from, message.role_chain_reply()));
  }
}

void RoleActor::OnLocal(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    case proto::Message::kPeerEvent:
      return OnPeerEvent(context, message.peer_event());
    case proto::Message::kStepDown:
      step_down_reason_ = "actor " + message.step_down().actor() + " fails: " + message.step_down().reason();
      return StepDownIfDue(context);
    case proto::Message::kLoadRolesReply:
      return OnLoadRolesReply(context, message.load_roles_reply());
    case proto::Message::kSaveRolesReply:
      return OnSaveRolesReply(context, message);
    case proto::Message::kRoleSetRequest:
      return OnRoleSetRequest(context, message);
    case proto::Message::kRoleShowRequest:
      return OnRoleShowRequest(context, message.role_show_request());
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    default:
      return;
  }
}

void RoleActor::OnTimer(Context& context, const proto::Timer& timer) {
  switch (timer.kind()) {
    case kStorage:
      storage_timer_ = 0;
      Perform(context, logic_.OnSaveLate());
      return RequestStorage(context);
    case kStore:
      store_timer_ = 0;
      return Perform(context, logic_.OnStoreTimer());
    case kAnnounce:
      announce_timer_ = 0;
      return Perform(context, logic_.OnAnnounceTimer());
    case kLeader:
      return Perform(context, logic_.OnLeaderTimer(context.utc_now_ns()));
    case kWaitIsOver:
      return;  // AnswerWhoWaits checks the waiting requests after each message.
    default:
      return;
  }
}

void RoleActor::OnPeerEvent(Context& context, const proto::PeerEvent& event) {
  if (!event.is_connected()) {
    connected_.erase(event.peer());
    return;
  }
  connected_.insert(event.peer());
  Perform(context, logic_.OnPeerConnected(event.peer()));
  StepDownIfDue(context);
}

void RoleActor::OnLoadRolesReply(Context& context, const proto::LoadRolesReply& reply) {
  if (logic_.is_loaded()) return;
  context.Cancel(storage_timer_);
  storage_timer_ = 0;
  const std::uint64_t epoch = context.rng()() | 1;
  Perform(context, logic_.OnLoaded({reply.history().begin(), reply.history().end()}, epoch, context.utc_now_ns(),
                                   {reply.known().begin(), reply.known().end()}));
  if (options_.sign) assignments_.Follow(context);
}

void RoleActor::OnSaveRolesReply(Context& context, const proto::Message& message) {
  if (!logic_.saving() || message.request_id() != storage_request_id_) return;
  context.Cancel(storage_timer_);
  storage_timer_ = 0;
  if (IsError(message.save_roles_reply().error())) {
    const Error error = FromProto(message.save_roles_reply().error());
    unstored_log_.Error(ToString(context.self()) + ": the roles could not be stored: " + ToString(error));
    Perform(context, logic_.OnSaveFailed());
    return AnswerRequester(context, error);
  }
  Perform(context, logic_.OnSaved());
  AnswerRequester(context, std::nullopt);
  StepDownIfDue(context);
}

void RoleActor::OnRoleSetRequest(Context& context, const proto::Message& message) {
  const proto::RoleSetRequest& request = message.role_set_request();
  if (request.wait_s() > 0 && waiting_.size() >= kWaitingMax) {
    (void)context.Reply(ErrorMessage(Error{ErrorCode::kFull, "too many requests wait for a change of roles", {}}));
    return;
  }
  Result<proto::RoleAssignment> roles = logic_.Propose(request, context.utc_now_ns());
  if (!roles) {
    (void)context.Reply(ErrorMessage(roles.error()));
    return;
  }
  if (request.is_dry_run()) {
    proto::RoleShowReply shown;
    *shown.mutable_roles() = *std::move(roles);
    (void)context.Reply(MessageOf(shown));
    return;
  }
  requester_ = Requester{context.sender(), message.request_id(), BoundedWait(request.wait_s(), kOrderWaitMax_s)};
  Perform(context, logic_.Adopt(*std::move(roles)));
}

void RoleActor::OnRoleShowRequest(Context& context, const proto::RoleShowRequest& request) {
  (void)context.Reply(MessageOf(Show(request.with_history())));
}

void RoleActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (!request || !request->has_status()) return;
  const Result<proto::RoleShowReply> shown = Show(/*with_history=*/false);
  if (!shown) {
    (void)context.Reply(ErrorMessage(shown.error()));
    return;
  }
  proto::ControlReply reply;
  proto::AgentStatus& status = *reply.mutable_status();
  *status.mutable_roles() = shown->roles();
  status.set_refused_announcements(shown->refused_announcements());
  if (shown->has_unstored()) *status.mutable_unstored_roles() = shown->unstored();
  for (const auto& [from, count] : refused_announcements_) {
    proto::RefusedFrom& refused = *status.add_refused();
    refused.set_agent_id(from);
    refused.set_cause(proto::REFUSAL_CAUSE_ROLES);
    refused.set_count(count);
  }
  (void)context.Reply(MessageOf(reply));
}

Result<proto::RoleShowReply> RoleActor::Show(bool with_history) const {
  if (!logic_.is_loaded()) {
    return Fail(ErrorCode::kUnavailable, "the stored roles are still being read; try again");
  }
  proto::RoleShowReply shown = logic_.Show(with_history);
  double refused = 0;
  for (const auto& [from, count] : refused_announcements_) refused += count;
  shown.set_refused_announcements(refused);
  return shown;
}

void RoleActor::OnRoleAnnounce(Context& context, AgentId from, const proto::RoleAnnounce& announce) {
  PerformOr(context, from, logic_.OnAnnounce(from, announce));
}

void RoleActor::OnRoleChainRequest(Context& context, const proto::RoleChainRequest& request) {
  proto::Message reply;
  reply.set_ms_type(proto::CONTROL);
  *reply.mutable_role_chain_reply() = logic_.OnChainRequest(request);
  (void)context.Reply(std::move(reply));
}

Result<void> RoleActor::OnRecord(Context& context, const proto::StoredRecord& stored) {
  proto::Record record;
  if (record.ParseFromString(stored.content())) Perform(context, logic_.OnRecord(record.role_assignment()));
  return {};
}

void RoleActor::PerformOr(Context& context, AgentId from, Result<RoleLogic::Actions> actions) {
  if (!actions) {
    ++refused_announcements_[from];
    refused_log_.Warn(ToString(context.self()) + ": refused the roles that agent " + std::to_string(from) +
                      " announced: " + ToString(actions.error()));
    return;
  }
  Perform(context, *std::move(actions));
}

void RoleActor::StepDownIfDue(Context& context) {
  if (!step_down_reason_) return;
  Result<proto::RoleAssignment> roles = logic_.ProposeStepDown(connected_, *step_down_reason_, context.utc_now_ns());
  if (roles) {
    spdlog::warn("{}: gives up its role, {}", ToString(context.self()), *step_down_reason_);
    Perform(context, logic_.Adopt(*std::move(roles)));
  } else if (roles.error().code == ErrorCode::kNotFound) {
    step_down_reason_.reset();
  }
}

void RoleActor::Perform(Context& context, RoleLogic::Actions actions) {
  if (actions.save) {
    ++storage_request_id_;
    RequestStorage(context);
  }
  if (actions.apply) Apply(context, *actions.apply);
  if (actions.question) {
    proto::Message message;
    message.set_ms_type(proto::CONTROL);
    *message.mutable_role_chain_request() = std::move(actions.question->request);
    (void)context.Send({actions.question->to, actor_name::kRole}, std::move(message));
  }
  for (RoleLogic::Announcement& announcement : actions.announcements) {
    proto::Message message;
    message.set_ms_type(proto::CONTROL);
    *message.mutable_term() = announcement.announce.roles().term();
    *message.mutable_role_announce() = std::move(announcement.announce);
    // RoleLogic repeats lost announcements, so ignore a failed send.
    (void)context.Send({announcement.to, actor_name::kRole}, std::move(message));
  }
  if (actions.announce_timer) {
    if (announce_timer_ != 0) context.Cancel(announce_timer_);
    announce_timer_ = context.AfterTimer(*actions.announce_timer, kAnnounce);
  }
  if (actions.leader_timer) context.AfterTimer(*actions.leader_timer, kLeader);
  if (actions.store_timer) {
    if (store_timer_ != 0) context.Cancel(store_timer_);
    store_timer_ = context.AfterTimer(*actions.store_timer, kStore);
  }
}

void RoleActor::Apply(Context& context, const proto::RoleAssignment& roles) {
  context.SetRoles(roles);
  proto::Message message;
  message.set_ms_type(proto::EVENT);
  *message.mutable_term() = roles.term();
  *message.mutable_roles_changed()->mutable_roles() = roles;
  message.mutable_roles_changed()->set_own_role(RoleOf(options_.team, roles, options_.self));
  context.Publish(std::move(message));
}

void RoleActor::RequestStorage(Context& context) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(storage_request_id_);
  if (!logic_.is_loaded()) {
    message.mutable_load_roles_request();
  } else if (logic_.saving()) {
    *message.mutable_save_roles_request()->mutable_roles() = *logic_.saving();
    for (proto::RoleAssignment& roles : logic_.SavingChain()) {
      *message.mutable_save_roles_request()->add_chain() = std::move(roles);
    }
  } else {
    return;
  }
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
  if (storage_timer_ != 0) context.Cancel(storage_timer_);
  storage_timer_ = context.AfterTimer(options_.storage_timeout, kStorage);
}

void RoleActor::AnswerRequester(Context& context, std::optional<Error> error) {
  if (!requester_) return;
  const Requester requester = *std::exchange(requester_, std::nullopt);
  if (error) return Answer(context, requester, tl::unexpected(*std::move(error)));
  proto::RoleShowReply shown = logic_.Show(/*with_history=*/false);
  if (requester.wait <= Duration::zero()) return Answer(context, requester, std::move(shown));
  waiting_.push_back({requester, shown.roles(), context.now() + requester.wait});
  context.AfterTimer(requester.wait, kWaitIsOver);
}

void RoleActor::Answer(Context& context, const Requester& requester, const Result<proto::RoleShowReply>& reply) {
  proto::Message message = MessageOf(reply);
  message.set_request_id(requester.request_id);
  (void)context.Send(requester.address, std::move(message));
}

void RoleActor::AnswerWhoWaits(Context& context) {
  std::erase_if(waiting_, [&](const Waiting& waiting) {
    const std::optional<Result<proto::RoleShowReply>> answer = AnswerTo(waiting, context.now());
    if (answer) Answer(context, waiting.requester, *answer);
    return answer.has_value();
  });
}

std::optional<Result<proto::RoleShowReply>> RoleActor::AnswerTo(const Waiting& waiting, MonotonicTime now) const {
  proto::RoleShowReply shown = logic_.Show(/*with_history=*/false);
  const AgentId leader = waiting.roles.leader();
  const AgentId survivor = waiting.roles.survivor();
  if (shown.roles().leader() != leader || shown.roles().survivor() != survivor) {
    return Fail(ErrorCode::kRefused, "a later change replaced this one: leader " +
                                         AgentName(options_.team, shown.roles().leader()) + ", survivor " +
                                         AgentName(options_.team, shown.roles().survivor()));
  }
  AddNotConfirmed(shown);
  if (!shown.not_confirmed_by().empty() && now < waiting.until) return std::nullopt;
  return shown;
}

}  // namespace moondb
