#include "actors/gateway/gateway_actor.h"

#include <algorithm>
#include <utility>

#include "actors/gateway/client_rights.h"
#include "actors/gateway/command_text.h"
#include "actors/gateway/request_check.h"
#include "model/agent_name.h"
#include "model/control_message.h"
#include "model/control_request.h"
#include "model/team_id.h"
#include "model/team_member.h"
#include "model/text.h"
#include "proto/types.pb.h"
#include "runtime/system_status.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kTimeOut = 1, kStopNow = 2, kCommandPeriod = 3, kRefusedPeriod = 4 };

// Refused and failed commands share one log period, whatever their kind.
constexpr auto kRefusedKind = proto::ControlRequest::REQUEST_NOT_SET;

// Messages between agents that are larger than this, in bytes, are not sent in the control class. A message of this
// size delays other control messages by 32 ms at 1 Mbit/s.
constexpr std::size_t kShortBytes = 4096;

proto::ControlReply ErrorReply(const Error& error) {
  proto::ControlReply reply;
  *reply.mutable_error() = ToProto(error);
  return reply;
}

// Gives the message a lower priority than all shared data.
void LetOthersGoFirst(proto::Message& message) {
  message.set_ms_type(proto::DATA);
  message.set_data_type(proto::LOCAL_TRAVERSABILITY_MAP);
}

}  // namespace

GatewayActor::GatewayActor(Options options)
    : options_(std::move(options)),
      log_(options_.log),
      refused_log_(options_.refused_log),
      roles_(InitialRoles(options_.team)) {}

void GatewayActor::OnStart(Context& context) {
  // Start at a random id: an answer to a request from before a restart must not match a new request.
  next_id_ = context.rng()() | 1;
  context.WatchPeers();
  context.Watch(Topic::kStored);
  context.Watch(Topic::kRoles);
  for (const char* actor :
       {actor_name::kSync, actor_name::kReplica, actor_name::kRole, actor_name::kStorage, actor_name::kMerge}) {
    context.Monitor({options_.self, actor});
  }
}

void GatewayActor::OnMessage(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    case proto::Message::kTimer:
      if (context.sender().agent == options_.self) OnTimer(context, message.timer());
      return;
    case proto::Message::kPeerEvent:
      if (context.sender().agent == options_.self && !message.peer_event().is_connected()) {
        OnPeerLost(context, static_cast<AgentId>(message.peer_event().peer()));
      }
      return;
    case proto::Message::kDown:
      if (context.sender().agent == options_.self) OnActorLost(context, message.down().actor());
      return;
    case proto::Message::kRecordsStored:
      if (context.sender() == Address{options_.self, actor_name::kStorage}) {
        OnRecordsStored(context, message.records_stored());
      }
      return;
    case proto::Message::kRolesChanged:
      if (context.sender() == Address{options_.self, actor_name::kRole}) roles_ = message.roles_changed().roles();
      return;
    default:
      return OnAnswer(context, message);
  }
}

void GatewayActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Address client = context.sender();
  Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (!request) return Answer(context, client, message.request_id(), ErrorReply(request.error()));
  if (client.agent == kClients) {
    if (auto allowed = CheckClientRights(message, request->request_case()); !allowed) {
      ++refused_requests_;
      return Answer(context, client, message.request_id(), ErrorReply(allowed.error()));
    }
  }
  request->set_by(ByOf(message, *request));
  OnCheckedRequest(context, message, *std::move(request));
}

void GatewayActor::OnCheckedRequest(Context& context, const proto::Message& message, proto::ControlRequest request) {
  const Address client = context.sender();
  const bool is_for_self = request.for_agent() == options_.self || (request.for_agent() == 0 && !IsPeer(client.agent));
  if (IsPeer(client.agent) && !is_for_self) {
    const Error error{ErrorCode::kRefused, "a request that another agent relays must be addressed to this agent",
                      "for_agent"};
    return Answer(context, client, message.request_id(), ErrorReply(error));
  }
  if (auto same = CheckTeamOf(request, options_.team); !same) {
    return Answer(context, client, message.request_id(), ErrorReply(same.error()));
  }
  if (IsPeer(client.agent)) {
    const Result<void> allowed = CheckRelayRights(options_.team, options_.self, roles_, client.agent, request);
    if (!allowed) return RefuseRelayed(context, message, request, allowed.error());
  }
  const AgentId asked = is_for_self ? options_.self : static_cast<AgentId>(request.for_agent());
  if (auto checked = CheckRequest(options_.team, asked, request); !checked) {
    return Answer(context, client, message.request_id(), ErrorReply(checked.error()));
  }
  if (is_for_self && request.has_stop()) {
    WriteDown(context, request);
    return OnStop(context, message);
  }
  if (is_for_self && request.has_trace()) {
    proto::ControlReply reply;
    *reply.mutable_trace() = context.GetTrace(request.trace());
    return Answer(context, client, message.request_id(), std::move(reply));
  }
  const bool is_feed = is_for_self && request.read().wait_s() > 0;
  Pending pending;
  pending.client = client;
  pending.client_name = message.client_name();
  pending.request = request.request_case();
  pending.client_request_id = message.request_id();
  if (!is_for_self) pending.relayed_to = static_cast<AgentId>(request.for_agent());
  pending.is_wait = is_for_self && WaitOf(request) > std::chrono::milliseconds(0);
  SetBudget(request, pending);
  if (auto room = CheckRoom(pending); !room) {
    return Answer(context, client, message.request_id(), ErrorReply(room.error()));
  }
  if (is_for_self) {
    pending.command = WriteDown(context, request);
    pending.by = request.by();
  }
  // The actor or the other agent may wait for wait_s before it answers.
  Duration timeout = TakesLong(request) ? options_.long_timeout : WaitOf(request) + options_.timeout;
  if (is_feed) {
    proto::ReadRequest page = request.read();
    BoundPage(page, IsPeer(client.agent));
    pending.feed.emplace(std::move(page), last_row_id_);
    timeout = WaitOf(request);
  }
  const std::uint64_t id = next_id_++;
  const Result<void> forwarded =
      is_for_self ? Forward(context, std::move(request), id, pending) : Relay(context, std::move(request), id, pending);
  if (!forwarded) pending.reply = ErrorReply(forwarded.error());
  pending.timer = context.AfterTimer(timeout, kTimeOut, id);
  pending_.emplace(id, std::move(pending));
  if (!forwarded) Finish(context, id);
}

void GatewayActor::RefuseRelayed(Context& context, const proto::Message& message, const proto::ControlRequest& request,
                                 const Error& error) {
  const AgentId from = context.sender().agent;
  ++refused_commands_[from];
  const std::string text = "refused " + RequestName(request.request_case()) + " relayed by " +
                           AgentName(options_.team, from) + ": command_from of the team file does not name this agent";
  WriteDownRefused(context, text, request.by());
  Answer(context, context.sender(), message.request_id(), ErrorReply(error));
}

void GatewayActor::SetBudget(proto::ControlRequest& request, Pending& pending) const {
  const bool is_peer = IsPeer(pending.client.agent);
  if (!pending.client_name.empty()) BoundKeyedPage(request);
  pending.owner = OwnerOf(pending.client_name, is_peer ? pending.client.agent : 0, pending.client.actor);
  pending.answer_bytes = AnswerBytesOf(request, pending.relayed_to != 0 || is_peer);
  if (pending.relayed_to != 0) pending.answer_bytes = std::min(pending.answer_bytes, options_.relay_bytes_max);
  pending.takes_turns = pending.relayed_to == 0 && TakesTurns(request) && (is_peer || !pending.client_name.empty());
}

ClientLoad GatewayActor::LoadFor(const Pending& pending) const {
  ClientLoad load{.pending = pending_.size()};
  for (const auto& [id, other] : pending_) {
    load.waits += other.is_wait ? 1 : 0;
    if (&other == &pending || other.owner != pending.owner) continue;
    ++load.own;
    load.own_waits += other.is_wait ? 1 : 0;
    load.own_relays += pending.relayed_to != 0 && other.relayed_to == pending.relayed_to ? 1 : 0;
    // A feed between two reads, and a request that waits for its turn, bring no answer yet.
    const bool is_being_answered = other.relayed_to != 0 || (!other.waiting_for.empty() && !other.question);
    load.own_bytes += is_being_answered ? other.answer_bytes : 0;
  }
  if (!pending.client_name.empty() && options_.unread_bytes) {
    load.unread_bytes = options_.unread_bytes(pending.client.actor);
  }
  return load;
}

Result<void> GatewayActor::CheckRoom(const Pending& pending) const {
  const ClientLoad load = LoadFor(pending);
  const std::string relayed_to = pending.relayed_to == 0 ? "" : AgentName(options_.team, pending.relayed_to);
  if (auto room = CheckRequestCount(options_, load, pending.is_wait, relayed_to); !room) return room;
  return pending.client_name.empty() ? Result<void>() : CheckAnswerBytes(load, pending.answer_bytes);
}

std::string GatewayActor::WriteDown(Context& context, const proto::ControlRequest& request) {
  std::string text = CommandText(options_.team, request);
  if (text.empty()) return text;
  const AgentId from = context.sender().agent;
  if (IsPeer(from)) text += ", through " + AgentName(options_.team, from);
  const CommandLog::Added added = log_.Add(request.request_case(), text, request.by(), context.utc_now_ns());
  if (added.begins_period) context.AfterTimer(options_.log.period, kCommandPeriod, request.request_case());
  Store(context, added.event);
  return text;
}

// Logs a failed command. The command was already logged before it was executed.
void GatewayActor::WriteDownFailure(Context& context, const Pending& pending) {
  const Error error = FromProto(pending.reply.error());
  // A timeout is not logged as a failure: the command may have been executed.
  if (error.code == ErrorCode::kTimedOut) return;
  const bool is_refused = error.code == ErrorCode::kRefused;
  WriteDownRefused(context, (is_refused ? "refused " : "failed: ") + pending.command + ": " + OneLine(error.text),
                   pending.by);
}

void GatewayActor::WriteDownRefused(Context& context, const std::string& text, const std::string& by) {
  const CommandLog::Added added = refused_log_.Add(kRefusedKind, text, by, context.utc_now_ns());
  if (added.begins_period) context.AfterTimer(options_.refused_log.period, kRefusedPeriod);
  Store(context, added.event);
}

// Asks storage to store the event, and does not wait for the result: a full disk must not prevent a role change.
void GatewayActor::Store(Context& context, const std::optional<proto::Record>& event) const {
  if (!event) return;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_insert_request()->add_records() = *event;
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
}

void GatewayActor::OnStop(Context& context, const proto::Message& message) {
  proto::ControlReply reply;
  reply.mutable_stop();
  Answer(context, context.sender(), message.request_id(), std::move(reply));
  context.AfterTimer(options_.stop_delay, kStopNow);
}

Result<void> GatewayActor::Forward(Context& context, proto::ControlRequest request, std::uint64_t id,
                                   Pending& pending) {
  const std::string& own_actor = request.custom().actor();
  if (request.has_custom() && !options_.own_actors.contains(own_actor)) {
    return Fail(ErrorCode::kNotFound, "this agent has no actor of its own named \"" + own_actor + "\"", "custom.actor");
  }
  for (Question& question : QuestionsOf(std::move(request), IsPeer(pending.client.agent))) {
    auto asked = RequestInTurn(context, std::move(question), id, pending);
    if (!asked) return asked;
  }
  return {};
}

Result<void> GatewayActor::RequestInTurn(Context& context, Question question, std::uint64_t id, Pending& pending) {
  if (!pending.takes_turns) return Ask(context, question.actor, std::move(question.message), id, pending);
  pending.queue = pending.owner + " " + question.actor;
  if (turns_.Add(pending.queue, id)) return Ask(context, question.actor, std::move(question.message), id, pending);
  pending.waiting_for.insert(question.actor);
  pending.question = std::move(question);
  return {};
}

void GatewayActor::EndTurn(Context& context, std::uint64_t id, Pending& pending) {
  if (pending.queue.empty()) return;
  pending.question.reset();
  const std::string queue = std::exchange(pending.queue, {});
  for (auto next = turns_.Remove(queue, id); next; next = turns_.Remove(queue, *next)) {
    Pending& waiting = pending_.at(*next);
    Question question = *std::exchange(waiting.question, std::nullopt);
    waiting.waiting_for.erase(question.actor);
    Result<void> asked;
    if (!waiting.client_name.empty()) asked = CheckAnswerBytes(LoadFor(waiting), waiting.answer_bytes);
    if (asked) asked = Ask(context, question.actor, std::move(question.message), *next, waiting);
    if (asked) return;
    waiting.queue.clear();
    *waiting.reply.mutable_error() = ToProto(asked.error());
    Finish(context, *next);
  }
}

Result<void> GatewayActor::Relay(Context& context, proto::ControlRequest request, std::uint64_t id, Pending& pending) {
  request.set_team_id(TeamIdBytes(options_.team.team_id()));
  proto::Message message = MessageOf(request);
  message.set_request_id(id);
  const std::size_t bytes = message.control_request().size();
  if (bytes > options_.relay_bytes_max) {
    return Fail(ErrorCode::kFull, "the request of " + std::to_string(bytes / 1024) +
                                      " KiB is too long for the radio; send less at a time, or ask the agent itself");
  }
  if (bytes > kShortBytes) LetOthersGoFirst(message);
  switch (context.Send({pending.relayed_to, actor_name::kGateway}, std::move(message))) {
    case SendResult::kAccepted:
      return {};
    case SendResult::kFull:
      return Fail(ErrorCode::kFull, "too many messages wait to be sent to " +
                                        AgentName(options_.team, pending.relayed_to) + "; try again later");
    default:
      return Fail(ErrorCode::kUnavailable, AgentName(options_.team, pending.relayed_to) + " cannot be reached from " +
                                               AgentName(options_.team, options_.self));
  }
}

Result<void> GatewayActor::Ask(Context& context, const std::string& actor, proto::Message message, std::uint64_t id,
                               Pending& pending) {
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(id);
  switch (context.Send({options_.self, actor}, std::move(message))) {
    case SendResult::kAccepted:
      pending.waiting_for.insert(actor);
      return {};
    case SendResult::kFull:
      return Fail(ErrorCode::kFull, "the actor " + actor + " is busy; try again later");
    default:
      return Fail(ErrorCode::kUnavailable, "this agent runs without the actor " + actor);
  }
}

void GatewayActor::OnAnswer(Context& context, const proto::Message& message) {
  const auto found = pending_.find(message.request_id());
  if (found == pending_.end()) return;  // The answer is late, or answers no request of this actor.
  Pending& pending = found->second;
  if (pending.relayed_to != 0) {
    if (context.sender() != Address{pending.relayed_to, actor_name::kGateway} ||
        message.body_case() != proto::Message::kControlReply)
      return;
    Result<proto::ControlReply> reply = ControlReplyOf(message);
    pending.reply = reply ? *std::move(reply) : ErrorReply(reply.error());
    return Finish(context, found->first);
  }
  if (context.sender().agent != options_.self) return;
  if (pending.waiting_for.erase(context.sender().actor) == 0) return;
  if (!TakeAnswer(pending.request, message, pending.reply)) {
    const Error error{
        ErrorCode::kInternal, context.sender().actor + " answered with an unexpected type of message", {}};
    *pending.reply.mutable_error() = ToProto(error);
  }
  if (pending.waiting_for.empty() && !KeepsWaiting(context, found->first, pending)) Finish(context, found->first);
}

bool GatewayActor::KeepsWaiting(Context& context, std::uint64_t id, Pending& pending) {
  const bool is_empty = pending.reply.read().records().empty() && !pending.reply.has_error();
  if (!pending.feed || !is_empty) return false;
  EndTurn(context, id, pending);
  pending.feed->OnEmptyPage(pending.reply.read().is_complete());
  if (pending.feed->is_stale()) RequestFeed(context, id, pending);
  return !pending.reply.has_error();
}

void GatewayActor::RequestFeed(Context& context, std::uint64_t id, Pending& pending) {
  proto::Message message;
  *message.mutable_read_request() = pending.feed->Ask(last_row_id_);
  const auto asked = RequestInTurn(context, {actor_name::kStorage, std::move(message)}, id, pending);
  if (!asked) *pending.reply.mutable_error() = ToProto(asked.error());
}

void GatewayActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  last_row_id_ = std::max(last_row_id_, stored.last_row_id());
  std::vector<std::uint64_t> failed;
  for (auto& [id, pending] : pending_) {
    if (!pending.feed || !pending.feed->Wants(stored)) continue;
    pending.feed->SetStale();
    if (!pending.waiting_for.empty()) continue;  // The read is repeated when the current answer arrives.
    RequestFeed(context, id, pending);
    if (pending.reply.has_error()) failed.push_back(id);
  }
  for (const std::uint64_t id : failed) Finish(context, id);
}

bool GatewayActor::EndsFeed(Context& context, std::uint64_t id, Pending& pending) {
  pending.feed.reset();
  if (pending.waiting_for.empty()) return true;
  pending.timer = context.AfterTimer(options_.timeout, kTimeOut, id);
  return false;
}

void GatewayActor::OnTimer(Context& context, const proto::Timer& timer) {
  if (timer.kind() == kStopNow) return context.RequestStop();
  if (timer.kind() == kCommandPeriod) {
    return Store(context, log_.OnPeriodEnd(static_cast<CommandLog::Kind>(timer.value()), context.utc_now_ns()));
  }
  if (timer.kind() == kRefusedPeriod) {
    return Store(context, refused_log_.OnPeriodEnd(kRefusedKind, context.utc_now_ns()));
  }
  const auto found = pending_.find(timer.value());
  if (found == pending_.end()) return;
  Pending& pending = found->second;
  if (pending.feed) {
    if (EndsFeed(context, found->first, pending)) Finish(context, found->first);
    return;
  }
  const std::string who =
      pending.relayed_to != 0 ? AgentName(options_.team, pending.relayed_to) : NamesText(pending.waiting_for);
  *found->second.reply.mutable_error() = ToProto(Error{ErrorCode::kTimedOut, who + " did not answer in time", {}});
  Finish(context, found->first);
}

void GatewayActor::OnPeerLost(Context& context, AgentId peer) {
  FailAll(
      context, [peer](const Pending& pending) { return pending.relayed_to == peer; },
      AgentName(options_.team, peer) + " disconnected before it answered; it may or may not have executed the request");
}

void GatewayActor::OnActorLost(Context& context, const std::string& actor) {
  const auto waits_there = [&actor](const Pending& pending) {
    const bool has_turn = !pending.queue.empty() && !pending.question;
    return pending.waiting_for.contains(actor) && ((pending.is_wait && !pending.feed) || has_turn);
  };
  FailAll(context, waits_there, actor + " restarted before it answered; ask again");
}

void GatewayActor::FailAll(Context& context, const std::function<bool(const Pending&)>& is_meant,
                           const std::string& text) {
  std::vector<std::uint64_t> lost;
  for (const auto& [id, pending] : pending_) {
    if (is_meant(pending)) lost.push_back(id);
  }
  for (const std::uint64_t id : lost) {
    if (!pending_.contains(id)) continue;  // The end of another request's turn has ended this request.
    *pending_.at(id).reply.mutable_error() = ToProto(Error{ErrorCode::kUnavailable, text, {}});
    Finish(context, id);
  }
}

void GatewayActor::CompleteStatus(Context& context, proto::AgentStatus& status) const {
  status.set_agent_id(options_.self);
  if (const proto::AgentConfig* own = FindAgent(options_.team, options_.self)) status.set_name(own->name());
  status.set_team(options_.team.team());
  status.set_role(RoleOf(options_.team, status.roles(), options_.self));
  if (options_.merge_backend) status.set_merge_backend(options_.merge_backend());
  status.set_version(options_.version);
  status.set_pid(options_.pid);
  if (options_.listener) *status.mutable_listener() = options_.listener();
  status.set_refused_clients(refused_requests_ + status.listener().unknown_client_keys());
  AddRefusedCommands(refused_commands_, status);
  const SystemStatus system = context.GetSystemStatus();
  status.set_uptime_s(std::chrono::duration<double>(system.uptime).count());
  for (const proto::PeerStatus& peer : system.peers) {
    proto::PeerStatus& shown = *status.add_peers();
    shown = peer;
    if (const proto::AgentConfig* agent = FindAgent(options_.team, peer.agent_id())) shown.set_name(agent->name());
  }
  for (const proto::ActorStatus& actor : system.actors) *status.add_actors() = actor;
}

void GatewayActor::Finish(Context& context, std::uint64_t id) {
  auto node = pending_.extract(id);
  if (node.empty()) return;  // The end of another request's turn has ended this request.
  Pending& pending = node.mapped();
  context.Cancel(pending.timer);
  if (pending.relayed_to == 0 && pending.reply.has_status()) CompleteStatus(context, *pending.reply.mutable_status());
  const bool is_acknowledged =
      pending.relayed_to == 0 && pending.reply.has_acknowledge() && !IsError(pending.reply.error());
  if (is_acknowledged) refused_commands_.clear();
  if (!pending.command.empty() && IsError(pending.reply.error())) WriteDownFailure(context, pending);
  Answer(context, pending.client, pending.client_request_id, std::move(pending.reply));
  EndTurn(context, id, pending);  // After the answer, so that its bytes count when the next turn begins.
}

proto::Message GatewayActor::AnswerOf(std::uint64_t request_id, proto::ControlReply reply) const {
  if (reply.team_id().empty() && reply.config_hash() == 0) {
    reply.set_team_id(TeamIdBytes(options_.team.team_id()));
    reply.set_config_hash(options_.config_hash);
  }
  proto::Message message = MessageOf(reply);
  message.set_request_id(request_id);
  return message;
}

void GatewayActor::Answer(Context& context, const Address& client, std::uint64_t request_id,
                          proto::ControlReply reply) {
  proto::Message message = AnswerOf(request_id, std::move(reply));
  const std::size_t bytes = IsPeer(client.agent) ? message.control_reply().size() : 0;
  if (bytes > options_.relay_bytes_max) {
    const std::string text = "the answer of " + std::to_string(bytes / 1024) +
                             " KiB is too long for the radio; ask for less, or ask the agent itself";
    message = AnswerOf(request_id, ErrorReply(Error{ErrorCode::kFull, text, {}}));
  } else if (bytes > kShortBytes) {
    LetOthersGoFirst(message);
  }
  const SendResult sent = context.Send(client, std::move(message));
  // If the queue to another agent is full, send a short error instead. After any other failure the client is gone.
  if (sent != SendResult::kFull || !IsPeer(client.agent)) return;
  const std::string text =
      "too many messages wait to be sent back to " + AgentName(options_.team, client.agent) + "; try again later";
  (void)context.Send(client, AnswerOf(request_id, ErrorReply(Error{ErrorCode::kFull, text, {}})));
}

}  // namespace moondb
