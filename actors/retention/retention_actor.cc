#include "actors/retention/retention_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <utility>

#include "model/agent_name.h"
#include "model/control_message.h"
#include "model/custom_types.h"
#include "model/event.h"
#include "model/have_set.h"
#include "model/team_member.h"
#include "model/text.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kLook = 1, kStage = 2 };

constexpr std::uint32_t kOccludedMapsMax = 4096;

double BytesOf(const proto::PruneReply& reply) {
  double bytes = 0;
  for (const proto::PrunedType& pruned : reply.pruned()) bytes += pruned.content_bytes();
  return bytes;
}

double CountOf(const proto::PruneReply& reply) {
  double count = 0;
  for (const proto::PrunedType& pruned : reply.pruned()) count += pruned.record_count();
  return count;
}

// Returns true if both assignments name the same leader and the same survivor.
bool HaveOneRoles(const proto::RoleAssignment& a, const proto::RoleAssignment& b) {
  return a.leader() == b.leader() && a.survivor() == b.survivor();
}

}  // namespace

void RetentionActor::OnStart(Context& context) {
  // Start at a random id. A late reply to a request from before a restart then matches no current request.
  request_id_ = context.rng()();
  context.Watch(Topic::kRoles);
  InspectLater(context);
}

// A random delay prevents the agents of a team from checking their limits at the same time.
void RetentionActor::InspectLater(Context& context) {
  const double part = std::uniform_real_distribution(0.5, 1.0)(context.rng());
  (void)context.AfterTimer(std::chrono::duration_cast<Duration>(part * options_.period), kLook);
}

void RetentionActor::OnMessage(Context& context, const proto::Message& message) {
  const AgentId from = context.sender().agent;
  if (from == options_.self) return OnLocal(context, message);
  if (FindAgent(options_.team, from) == nullptr || context.sender().actor != actor_name::kRetention) return;
  if (message.body_case() == proto::Message::kControlRequest) {
    const Result<proto::ControlRequest> request = ControlRequestOf(message);
    if (request && request->has_have()) OnPeersQuestion(context, from, message.request_id());
  }
  if (message.body_case() == proto::Message::kControlReply) {
    const Result<proto::ControlReply> reply = ControlReplyOf(message);
    if (reply && reply->has_have() && IsAnswer(message, Stage::kPeers)) OnPeersHave(context, from, reply->have());
  }
}

void RetentionActor::OnLocal(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kTimer:
      if (context.sender() == context.self()) OnTimer(context, message.timer());
      return;
    case proto::Message::kRolesChanged:
      return OnRolesChanged(context, message.roles_changed().roles());
    case proto::Message::kPruneOrder:
      return OnOrder(context, message);
    case proto::Message::kHaveReply:
      return OnOwnHave(context, message);
    case proto::Message::kRoleShowReply:
      if (IsAnswer(message, Stage::kRoles)) OnRoles(context, message.role_show_reply().roles());
      return;
    case proto::Message::kOccludedMapsReply:
      if (!IsAnswer(message, Stage::kOccludedMaps)) return;
      *job_.plan[job_.step].request.mutable_records() = message.occluded_maps_reply().records();
      job_.plan[job_.step].is_of_occluded_maps = false;
      // An empty list means "all types" to storage, so the step is skipped.
      if (message.occluded_maps_reply().records().empty()) ++job_.step;
      return DoStep(context);
    case proto::Message::kPruneReply:
      if (IsAnswer(message, Stage::kPruning)) OnPruned(context, message.prune_reply());
      return;
    case proto::Message::kControlReply:
      if (stage_ != Stage::kIdle && message.request_id() == request_id_) OnControlReply(context, message);
      return;
    default:
      return;
  }
}

// Handles storage's reply to the status request. Any other ControlReply is an error.
void RetentionActor::OnControlReply(Context& context, const proto::Message& message) {
  const Result<proto::ControlReply> reply = ControlReplyOf(message);
  if (stage_ == Stage::kStatus && reply && reply->status().has_storage()) {
    Job job;
    job.plan = PlanOf(options_.team.retention(), DataTypesOf(options_.team), reply->status().storage());
    return Begin(context, std::move(job));
  }
  if (SkipsOccludedMaps(context)) return;
  GiveUp(context, reply ? FromProto(reply->error()) : reply.error());
}

void RetentionActor::OnTimer(Context& context, const proto::Timer& timer) {
  if (timer.kind() == kLook) {
    InspectLater(context);
    if (stage_ != Stage::kIdle || !HasLimits(options_.team.retention())) return;
    Enter(context, Stage::kStatus, options_.own_timeout);
    proto::ControlRequest question;
    question.mutable_status();
    Ask(context, actor_name::kStorage, MessageOf(question));
    return;
  }
  if (timer.kind() != kStage || stage_ == Stage::kIdle || timer.value() != request_id_) return;
  if (stage_ == Stage::kPeers) return Refuse(context, job_.awaited.begin()->second + ", did not answer in time");
  if (SkipsOccludedMaps(context)) return;
  const char* who = stage_ == Stage::kRoles          ? actor_name::kRole
                    : stage_ == Stage::kOccludedMaps ? actor_name::kMerge
                                                     : actor_name::kStorage;
  GiveUp(context, {ErrorCode::kTimedOut, std::string(who) + " did not answer in time", {}});
}

bool RetentionActor::SkipsOccludedMaps(Context& context) {
  if (stage_ != Stage::kOccludedMaps || job_.requester) return false;
  ++job_.step;
  DoStep(context);
  return true;
}

// Returns true if the plan prunes this agent's history. No other agent has the history, so no peer is asked first.
bool RetentionActor::IsOfHistory() const { return !job_.plan.empty() && job_.plan.front().request.is_history(); }

bool RetentionActor::IsDryRun() const { return !job_.plan.empty() && job_.plan.front().request.is_dry_run(); }

// --- Requests of other agents ---

// While it prunes, this agent reports an empty have-set. Otherwise two agents could delete each other's last copy. If
// two agents ask each other at the same time, the agent with the larger id gives up its prune.
void RetentionActor::OnPeersQuestion(Context& context, AgentId peer, std::uint64_t request_id) {
  const bool asks_peer = stage_ == Stage::kPeers && job_.peers.contains(peer);
  if (asks_peer && peer < options_.self)
    Refuse(context, AgentName(options_.team, peer) + " is pruning its own records now");
  if (stage_ != Stage::kIdle && stage_ != Stage::kStatus && !IsDryRun()) {
    return Vouch(context, peer, request_id, proto::HaveReply());
  }
  Asked& asked = asked_[peer];
  asked.request_id = request_id;
  asked.storage_request_id = context.rng()();
  proto::Message question;
  question.set_ms_type(proto::CONTROL);
  question.set_request_id(asked.storage_request_id);
  question.mutable_have_request();
  // If this send fails, the peer gets no answer and keeps its records.
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(question));
}

void RetentionActor::OnOwnHave(Context& context, const proto::Message& message) {
  const auto found = std::find_if(asked_.begin(), asked_.end(), [&message](const auto& one) {
    return one.second.storage_request_id == message.request_id();
  });
  if (found == asked_.end()) return;
  proto::HaveReply covered;
  for (const proto::StreamHave& stream : message.have_reply().have().streams()) {
    // Only types under the policy `all` are ever pruned. Leave out other types, whose have-sets have many intervals.
    if (SharePolicyOf(options_.team, stream.data_type()) == proto::POLICY_ALL)
      *covered.mutable_have()->add_streams() = stream;
  }
  Vouch(context, found->first, found->second.request_id, std::move(covered));
  asked_.erase(found);
}

void RetentionActor::Vouch(Context& context, AgentId peer, std::uint64_t request_id, proto::HaveReply covered) {
  proto::ControlReply reply;
  if (roles_) *covered.mutable_roles() = *roles_;
  *reply.mutable_have() = std::move(covered);
  proto::Message answer = MessageOf(reply);
  answer.set_request_id(request_id);
  (void)context.Send({peer, actor_name::kRetention}, std::move(answer));
}

// --- Prunes of this agent ---

void RetentionActor::OnOrder(Context& context, const proto::Message& message) {
  if (const Result<void> checked = CheckOrder(message.prune_order()); !checked) {
    proto::Message reply;
    reply.set_ms_type(proto::CONTROL);
    *reply.mutable_prune_reply()->mutable_error() = ToProto(checked.error());
    (void)context.Reply(std::move(reply));
    return;
  }
  Job job;
  job.requester = context.sender();
  job.requester_request_id = message.request_id();
  job.plan = PlanOf(message.prune_order(), DataTypesOf(options_.team));
  Begin(context, std::move(job));
}

Result<void> RetentionActor::CheckOrder(const proto::PruneOrder& order) const {
  const auto events = std::find(order.data_types().begin(), order.data_types().end(), proto::AGENT_EVENT);
  if (events != order.data_types().end() && !order.is_history()) {
    return Fail(ErrorCode::kInvalid,
                "agent_event cannot be pruned on command, as it records who commanded what: set "
                "retention.keep_event_days in the team file",
                "prune.data_types[" + std::to_string(events - order.data_types().begin()) + "]");
  }
  for (int i = 0; i < order.data_types_size() && !order.is_history(); ++i) {
    const DataType type = order.data_types(i);
    if (SharePolicyOf(options_.team, type) == proto::POLICY_ALL) continue;
    return Fail(ErrorCode::kInvalid,
                DataTypeName(type, options_.team.custom_types()) +
                    " does not have the share policy \"all\": only types with this "
                    "policy are pruned",
                "prune.data_types[" + std::to_string(i) + "]");
  }
  if (stage_ == Stage::kIdle) return {};
  return Fail(ErrorCode::kFull, "this agent prunes already; try again later");
}

void RetentionActor::Begin(Context& context, Job job) {
  job_ = std::move(job);
  if (job_.plan.empty()) return Finish(context);
  if (IsOfHistory()) return DoStep(context);
  RequestRoles(context);
}

void RetentionActor::RequestRoles(Context& context) {
  Enter(context, Stage::kRoles, options_.own_timeout);
  proto::Message question;
  question.mutable_role_show_request();
  Ask(context, actor_name::kRole, std::move(question));
}

void RetentionActor::OnRolesChanged(const Context& context, const proto::RoleAssignment& roles) {
  if (roles_ && !HaveOneRoles(*roles_, roles)) roles_since_ = context.now();
  roles_ = roles;
}

void RetentionActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  if (roles.leader() == 0) return Refuse(context, "the team has no leader");
  if (roles.survivor() == 0) return Refuse(context, "the team has no designated survivor");
  if (roles_since_ && context.now() - *roles_since_ < options_.roles_held_min) {
    const auto minutes = std::chrono::ceil<std::chrono::minutes>(options_.roles_held_min).count();
    return Refuse(context, "leader or survivor changed within the last " + std::to_string(minutes) + " minutes");
  }
  job_.roles = roles;
  job_.awaited.clear();
  job_.peers.clear();
  job_.asked_at = context.now();
  for (const auto& [agent, role] :
       {std::pair(roles.leader(), "the leader"), std::pair(roles.survivor(), "the designated survivor")}) {
    if (agent == options_.self) continue;
    if (HasLeft(options_.team, agent)) {
      return Refuse(context, AgentName(options_.team, agent) + ", " + role + ", has left the team");
    }
    job_.peers[static_cast<AgentId>(agent)] = {};
    job_.awaited[static_cast<AgentId>(agent)] = AgentName(options_.team, static_cast<AgentId>(agent)) + ", " + role;
  }
  Enter(context, Stage::kPeers, options_.peer_timeout);
  proto::ControlRequest request;
  request.mutable_have();
  for (const auto& [agent, name] : job_.awaited) {
    proto::Message question = MessageOf(request);
    question.set_request_id(request_id_);
    if (context.Send({agent, actor_name::kRetention}, std::move(question)) == SendResult::kAccepted) continue;
    return Refuse(context, name + ", cannot be reached");
  }
}

void RetentionActor::OnPeersHave(Context& context, AgentId peer, const proto::HaveReply& covered) {
  const auto awaited = job_.awaited.find(peer);
  if (awaited == job_.awaited.end()) return;
  if (covered.has_roles() && !HaveOneRoles(covered.roles(), job_.roles)) {
    return Refuse(context, awaited->second + ", acts on other role assignments");
  }
  const Result<HaveSet> have = FromProto(covered.have());
  if (!have) return Refuse(context, awaited->second + ", sent an invalid have-set: " + ToString(have.error()));
  job_.peers[peer] = *have;
  job_.awaited.erase(awaited);
  if (job_.awaited.empty()) DoStep(context);
}

void RetentionActor::DoStep(Context& context) {
  const auto is_done = [this](const PruneStep& step) {
    return step.until_bytes > 0 && job_.removed_bytes >= step.until_bytes;
  };
  while (job_.step < job_.plan.size() && is_done(job_.plan[job_.step])) ++job_.step;
  if (job_.step == job_.plan.size()) {
    job_.reply.set_is_complete(true);
    return Finish(context);
  }
  const PruneStep& step = job_.plan[job_.step];
  proto::Message message;
  if (step.is_of_occluded_maps) {
    Enter(context, Stage::kOccludedMaps, options_.merge_timeout);
    message.mutable_occluded_maps_request()->set_records_max(kOccludedMapsMax);
    Ask(context, actor_name::kMerge, std::move(message));
    return;
  }
  if (!IsOfHistory() && context.now() - job_.asked_at > options_.vouched_for) return RequestRoles(context);
  proto::PruneRequest& request = *message.mutable_prune_request();
  request = step.request;
  HaveSet held;
  for (const auto& [peer, covered] : job_.peers) {
    *request.add_acknowledged() = ToProto(covered);
    for (const auto& [stream, state] : covered.streams()) held[stream].held.Add(state.held);
  }
  // An age limit may remove the last copy of a record. With any other limit, a peer must still hold a copy.
  if (step.request.older_than_s() == 0) *request.add_acknowledged() = ToProto(held);
  if (step.until_bytes > 0) request.set_content_bytes_max(step.until_bytes - job_.removed_bytes);
  Enter(context, Stage::kPruning, options_.own_timeout);
  Ask(context, actor_name::kStorage, std::move(message));
}

void RetentionActor::OnPruned(Context& context, const proto::PruneReply& reply) {
  if (IsError(reply.error())) return GiveUp(context, FromProto(reply.error()));
  if (!reply.text().empty()) {
    job_.reply.set_text(reply.text());
    ++job_.step;
    return DoStep(context);
  }
  const PruneStep& step = job_.plan[job_.step];
  AddPruned(reply);
  const bool is_by_age = step.request.older_than_s() > 0 && !step.request.is_dry_run();
  for (const proto::PrunedType& pruned : reply.pruned()) {
    if (is_by_age) job_.aged[pruned.data_type()] += pruned.record_count();
  }
  // Do not repeat a step that removed nothing: it would repeat forever.
  const bool goes_on = !reply.is_complete() && !step.request.is_dry_run() && !reply.pruned().empty();
  if (!goes_on) {
    job_.reply.set_unacknowledged_count(job_.reply.unacknowledged_count() + reply.unacknowledged_count());
    ++job_.step;
  }
  DoStep(context);
}

void RetentionActor::AddPruned(const proto::PruneReply& reply) {
  job_.removed_bytes += BytesOf(reply);
  for (const proto::PrunedType& pruned : reply.pruned()) {
    auto& types = *job_.reply.mutable_pruned();
    auto known = std::find_if(types.begin(), types.end(), [&pruned](const proto::PrunedType& type) {
      return type.data_type() == pruned.data_type();
    });
    if (known == types.end()) {
      *job_.reply.add_pruned() = pruned;
      continue;
    }
    known->set_record_count(known->record_count() + pruned.record_count());
    known->set_content_bytes(known->content_bytes() + pruned.content_bytes());
  }
}

// --- Stages ---

void RetentionActor::Enter(Context& context, Stage stage, Duration timeout) {
  context.Cancel(stage_timer_);
  stage_ = stage;
  ++request_id_;
  stage_timer_ = context.AfterTimer(timeout, kStage, request_id_);
}

void RetentionActor::Ask(Context& context, const char* actor, proto::Message message) {
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(request_id_);
  const SendResult sent = context.Send({options_.self, actor}, std::move(message));
  if (sent == SendResult::kAccepted) return;
  GiveUp(context, {ErrorCode::kUnavailable, std::string(actor) + " does not accept requests: " + ToString(sent), {}});
}

void RetentionActor::Refuse(Context& context, const std::string& text) {
  job_.reply.set_text(text);
  job_.reply.set_is_complete(true);
  Finish(context);
}

void RetentionActor::GiveUp(Context& context, const Error& error) {
  *job_.reply.mutable_error() = ToProto(error);
  Finish(context);
}

void RetentionActor::LogAged(Context& context) {
  double count = 0;
  std::string types;
  for (const auto& [type, of_type] : job_.aged) {
    count += of_type;
    types += (types.empty() ? "" : ", ") + DataTypeName(type) + " " + FormatDouble(of_type);
  }
  if (count == 0) return;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_insert_request()->add_records() =
      MakeEvent(proto::EVENT_KIND_PRUNED,
                "removed " + FormatDouble(count) + (IsOfHistory() ? " superseded" : "") +
                    " records because of their age: " + types,
                "", context.utc_now_ns());
  // The event only informs people: a full mailbox costs no more than the event.
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
}

void RetentionActor::Finish(Context& context) {
  context.Cancel(stage_timer_);
  LogAged(context);
  stage_ = Stage::kIdle;
  const Job job = std::exchange(job_, {});
  if (job.requester) {
    proto::Message reply;
    reply.set_ms_type(proto::CONTROL);
    reply.set_request_id(job.requester_request_id);
    *reply.mutable_prune_reply() = job.reply;
    (void)context.Send(*job.requester, std::move(reply));
    return;
  }
  if (CountOf(job.reply) > 0) {
    spdlog::info("{}: removed {:.0f} records, {:.0f} bytes; {:.0f} were kept because leader or survivor lacks them",
                 ToString(context.self()), CountOf(job.reply), BytesOf(job.reply), job.reply.unacknowledged_count());
  }
  const std::string refusal = IsError(job.reply.error()) ? ToString(FromProto(job.reply.error())) : job.reply.text();
  if (!refusal.empty() && refusal != last_refusal_) {
    spdlog::warn("{}: removes nothing{}: {}", ToString(context.self()), CountOf(job.reply) > 0 ? " more" : "", refusal);
  }
  last_refusal_ = refusal;
}

}  // namespace moondb
