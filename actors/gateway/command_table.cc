#include "actors/gateway/command_table.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "actors/gateway/command_text.h"
#include "actors/gateway/request_check.h"
#include "model/control_message.h"
#include "model/control_request.h"
#include "model/term.h"

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using Request = proto::ControlRequest;
using Team = proto::TeamConfig;

struct Command {
  Request::RequestCase request;
  Result<void> (*check)(const Team& team, AgentId asked, const Request& request) = nullptr;
  std::string (*text)(const Team& team, const Request& request) = nullptr;
  std::vector<Question> (*ask)(Request& request, bool is_relayed) = nullptr;
  void (*merge)(const proto::ControlReply& part, proto::ControlReply& whole) = nullptr;
};

// --- Requests that are sent in a special way ---

// Returns the name of the i-th actor that proto/control.proto declares for the request.
const std::string& ActorOf(const Request& request, int i = 0) {
  return CommandOptionsOf(request.request_case()).actors(i);
}

// Returns a list with one question. A braced list would copy the message.
std::vector<Question> RequestOne(const std::string& actor, proto::Message message) {
  std::vector<Question> questions;
  questions.push_back({actor, std::move(message)});
  return questions;
}

std::vector<Question> RequestPage(Request& request, bool is_relayed) {
  proto::Message message;
  message.mutable_read_request()->Swap(request.mutable_read());
  BoundPage(*message.mutable_read_request(), is_relayed);
  return RequestOne(ActorOf(request), std::move(message));
}

// Requests this agent's complete have-set.
std::vector<Question> RequestHave(Request& request, bool) {
  proto::Message message;
  message.mutable_have_request();
  return RequestOne(ActorOf(request), std::move(message));
}

// Returns the name of the actor for `kind`: SyncActor or ReplicaActor.
const std::string& ActorOfKind(const Request& request, proto::SharingKind kind) {
  return ActorOf(request, kind == proto::SHARING_KIND_SYNC ? 0 : 1);
}

std::vector<Question> RequestShare(Request& request, bool) {
  const std::string& actor = ActorOfKind(request, request.share().kind());
  proto::Message message;
  message.mutable_share_request()->Swap(request.mutable_share());
  return RequestOne(actor, std::move(message));
}

std::vector<Question> RequestProgress(Request& request, bool is_relayed) {
  const std::string& actor = ActorOfKind(request, request.share_progress().kind());
  proto::Message message;
  message.mutable_share_progress_request()->Swap(request.mutable_share_progress());
  message.mutable_share_progress_request()->set_is_relayed(is_relayed);
  return RequestOne(actor, std::move(message));
}

std::vector<Question> RequestOwnActor(Request& request, bool) {
  proto::Message message;
  message.mutable_custom()->Swap(request.mutable_custom()->mutable_body());
  return RequestOne(request.custom().actor(), std::move(message));
}

// --- Answers that are merged in a special way ---

// Merges the statuses of SyncActor and ReplicaActor.
void MergeShareStatus(const proto::ControlReply& reply, proto::ControlReply& whole_reply) {
  const proto::ShareStatus& part = reply.share_status();
  proto::ShareStatus& whole = *whole_reply.mutable_share_status();
  whole.mutable_sessions()->MergeFrom(part.sessions());
  whole.set_received_records(whole.received_records() + part.received_records());
  whole.set_rejected_records(whole.rejected_records() + part.rejected_records());
  whole.set_damaged_messages(whole.damaged_messages() + part.damaged_messages());
  whole.set_dropped_messages(whole.dropped_messages() + part.dropped_messages());
  whole.set_refused_hellos(whole.refused_hellos() + part.refused_hellos());
  // Keep the newer roles: SyncActor and ReplicaActor learn of new roles at slightly different times.
  if (!whole.has_roles() || IsNewer(whole.roles().term(), part.roles().term())) *whole.mutable_roles() = part.roles();
  whole.mutable_gathers_from()->MergeFrom(part.gathers_from());
  whole.mutable_gathers_later()->MergeFrom(part.gathers_later());
  whole.mutable_due()->MergeFrom(part.due());
  if (part.gathers_now_from() != 0) whole.set_gathers_now_from(part.gathers_now_from());
  for (const AgentId agent : part.other_config_agents()) {
    const auto& known = whole.other_config_agents();
    if (std::find(known.begin(), known.end(), agent) == known.end()) whole.add_other_config_agents(agent);
  }
}

// --- The table: requests with a rule, a log text, or special sending or merging ---

constexpr Command kCommands[] = {
    {.request = Request::kInsert,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckInsert(team, request.insert()); }},
    {.request = Request::kRead,
     .check = [](const Team&, AgentId, const Request& request) { return CheckRead(request.read()); },
     .ask = RequestPage},
    {.request = Request::kRoleSet,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckRoleSet(team, request.role_set()); },
     .text = [](const Team& team, const Request& request) { return RoleText(team, request.role_set()); }},
    {.request = Request::kShare,
     .check = [](const Team& team, AgentId asked,
                 const Request& request) { return CheckShare(team, asked, request.share()); },
     .text = [](const Team& team, const Request& request) { return ShareText(team, request.share()); },
     .ask = RequestShare},
    {.request = Request::kShareStatus, .merge = MergeShareStatus},
    {.request = Request::kShareProgress,
     .check = [](const Team&, AgentId, const Request& request) { return CheckShareProgress(request.share_progress()); },
     .ask = RequestProgress},
    {.request = Request::kOptimize,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckOptimize(team, request.optimize()); },
     .text = [](const Team&, const Request& request) { return OptimizeText(request.optimize()); }},
    {.request = Request::kRegistration,
     .check = [](const Team&, AgentId, const Request& request) { return CheckRegistration(request.registration()); }},
    {.request = Request::kMerge,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckMerge(team, request.merge()); }},
    {.request = Request::kCustom, .ask = RequestOwnActor},
    {.request = Request::kLease,
     .text = [](const Team&, const Request& request) { return LeaseText(request.lease()); }},
    {.request = Request::kHave, .ask = RequestHave},
    {.request = Request::kMapWhy,
     .check = [](const Team&, AgentId, const Request& request) { return CheckMapWhy(request.map_why()); }},
    {.request = Request::kMapTiles,
     .check = [](const Team&, AgentId, const Request& request) { return CheckMapTiles(request.map_tiles()); }},
    {.request = Request::kPrune,
     .check = [](const Team&, AgentId, const Request& request) { return CheckPrune(request.prune()); },
     .text = [](const Team&, const Request& request) { return PruneText(request.prune()); }},
    {.request = Request::kDownlink,
     .text = [](const Team&, const Request& request) { return DownlinkText(request.downlink()); }},
    {.request = Request::kAcknowledge,
     .check = [](const Team&, AgentId, const Request& request) { return CheckAcknowledge(request.acknowledge()); },
     .text = [](const Team&, const Request&) { return std::string("health acknowledge"); }},
};

// Returns the request's row in kCommands; null if there is none.
const Command* FindCommand(Request::RequestCase request) {
  const auto* found = std::find_if(std::begin(kCommands), std::end(kCommands),
                                   [request](const Command& command) { return command.request == request; });
  return found == std::end(kCommands) ? nullptr : found;
}

// --- Lookup by type ---

// Returns the field of the oneof Message::body that has this message type; null if there is none.
const FieldDescriptor* BodyOfType(const Descriptor* type) {
  static const auto* const bodies = proto::Message::descriptor()->FindOneofByName("body");
  for (int i = 0; i < bodies->field_count(); ++i) {
    if (bodies->field(i)->message_type() == type) return bodies->field(i);
  }
  return nullptr;
}

// Returns the field of this request in ControlRequest; null if this version does not know the request.
const FieldDescriptor* FieldOf(Request::RequestCase request) {
  return Request::descriptor()->FindFieldByNumber(request);
}

// Returns the field of ControlReply that answers the request, or null if there is none. The field has the request's
// name, except that role_show and role_set share the field `roles`.
const FieldDescriptor* ReplyFieldOf(Request::RequestCase request) {
  if (request == Request::kRoleShow || request == Request::kRoleSet) {
    return proto::ControlReply::descriptor()->FindFieldByNumber(proto::ControlReply::kRolesFieldNumber);
  }
  const FieldDescriptor* asked = FieldOf(request);
  return asked == nullptr ? nullptr : proto::ControlReply::descriptor()->FindFieldByName(asked->name());
}

// Returns a message with the request as its body. Moves the contents out of the request.
proto::Message TakeMessageOf(Request& request) {
  const FieldDescriptor* field = FieldOf(request.request_case());
  const FieldDescriptor* body = BodyOfType(field->message_type());
  if (body == nullptr) return MessageOf(request);
  proto::Message message;
  google::protobuf::Message* taken = message.GetReflection()->MutableMessage(&message, body);
  taken->GetReflection()->Swap(taken, request.GetReflection()->MutableMessage(&request, field));
  return message;
}

void CopyError(const google::protobuf::Message& part, proto::ControlReply& reply) {
  const FieldDescriptor* field = part.GetDescriptor()->FindFieldByName("error");
  if (field == nullptr || !part.GetReflection()->HasField(part, field)) return;
  const auto& error = static_cast<const proto::Error&>(part.GetReflection()->GetMessage(part, field));
  if (IsError(error)) *reply.mutable_error() = error;
}

bool TakeControlReply(Request::RequestCase request, const proto::Message& answer, proto::ControlReply& reply) {
  const Result<proto::ControlReply> part = ControlReplyOf(answer);
  if (!part) return false;
  const FieldDescriptor* field = ReplyFieldOf(request);
  const bool is_error_alone = field == nullptr || !part->GetReflection()->HasField(*part, field);
  const Command* command = FindCommand(request);
  if (is_error_alone || command == nullptr || command->merge == nullptr) {
    reply.MergeFrom(*part);
  } else {
    command->merge(*part, reply);
  }
  if (!is_error_alone) CopyError(part->GetReflection()->GetMessage(*part, field), reply);
  return true;
}

}  // namespace

Result<void> CheckRequest(const Team& team, AgentId asked, const Request& request) {
  if (auto checked = CheckForAgent(team, request); !checked) return checked;
  if (FieldOf(request.request_case()) == nullptr) {
    return Fail(ErrorCode::kInvalid, "holds no request that this version knows", "request");
  }
  const Command* command = FindCommand(request.request_case());
  return command == nullptr || command->check == nullptr ? Result<void>() : command->check(team, asked, request);
}

std::string CommandText(const Team& team, const Request& request) {
  const Command* command = FindCommand(request.request_case());
  if (command != nullptr && command->text != nullptr) return command->text(team, request);
  const bool is_command = CommandOptionsOf(request.request_case()).rights() == proto::CLIENT_RIGHTS_COMMAND;
  return is_command ? RequestName(request.request_case()) : "";
}

std::vector<Question> QuestionsOf(Request request, bool is_relayed) {
  if (FieldOf(request.request_case()) == nullptr) return {};
  const Command* command = FindCommand(request.request_case());
  if (command != nullptr && command->ask != nullptr) return command->ask(request, is_relayed);
  const auto& actors = CommandOptionsOf(request.request_case()).actors();
  if (actors.size() == 1) return RequestOne(actors.Get(0), TakeMessageOf(request));
  std::vector<Question> questions;
  for (const std::string& actor : actors) questions.push_back({actor, MessageOf(request)});
  return questions;
}

bool TakeAnswer(Request::RequestCase request, const proto::Message& answer, proto::ControlReply& reply) {
  if (answer.body_case() == proto::Message::kControlReply) return TakeControlReply(request, answer, reply);
  const FieldDescriptor* body = proto::Message::descriptor()->FindFieldByNumber(answer.body_case());
  const FieldDescriptor* field = ReplyFieldOf(request);
  if (body == nullptr || field == nullptr || body->message_type() != field->message_type()) return false;
  const google::protobuf::Message& part = answer.GetReflection()->GetMessage(answer, body);
  reply.GetReflection()->MutableMessage(&reply, field)->CopyFrom(part);
  CopyError(part, reply);
  return true;
}

}  // namespace moondb
