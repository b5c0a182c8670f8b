#include "actors/gateway/command_table.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "actors/gateway/command_text.h"
#include "actors/gateway/request_check.h"
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
  std::vector<Question> (*ask)(const Request& request, bool is_relayed) = nullptr;
  bool (*take)(const proto::Message& answer, proto::ControlReply& reply) = nullptr;
};

// --- What is asked otherwise ---

// As proto/control.proto names them.
const std::string& ActorOf(const Request& request, int i = 0) {
  return CommandOptionsOf(request.request_case()).actors(i);
}

std::vector<Question> AskForStatus(const Request& request, bool) {
  std::vector<Question> questions(4);
  questions[0].message.mutable_storage_status_request();
  questions[1].message.mutable_role_show_request();
  questions[2].message.mutable_lease_show_request();
  questions[3].message.mutable_findings_request();
  for (int i = 0; i < 4; ++i) questions[i].actor = ActorOf(request, i);
  return questions;
}

std::vector<Question> AskForPage(const Request& request, bool is_relayed) {
  Question question{ActorOf(request), {}};
  *question.message.mutable_read_request() = request.read();
  BoundPage(*question.message.mutable_read_request(), is_relayed);
  return {std::move(question)};
}

// What this agent has itself, not what it would say to a peer.
std::vector<Question> AskForHave(const Request& request, bool) {
  Question question{ActorOf(request), {}};
  question.message.mutable_have_request();
  return {std::move(question)};
}

std::vector<Question> AskToShare(const Request& request, bool) {
  Question question{ActorOf(request, request.share().kind() == proto::SHARING_KIND_SYNC ? 0 : 1), {}};
  *question.message.mutable_share_request() = request.share();
  return {std::move(question)};
}

std::vector<Question> AskOwnActor(const Request& request, bool) {
  Question question{request.custom().actor(), {}};
  *question.message.mutable_custom() = request.custom().body();
  return {std::move(question)};
}

// --- What is answered otherwise ---

bool TakeStatus(const proto::Message& answer, proto::ControlReply& reply) {
  proto::AgentStatus& status = *reply.mutable_status();
  switch (answer.body_case()) {
    case proto::Message::kStorageStatus:
      *status.mutable_storage() = answer.storage_status();
      return true;
    case proto::Message::kLeasesChanged:
      *status.mutable_leases() = answer.leases_changed().leases();
      return true;
    case proto::Message::kFindingsReply:
      *status.mutable_findings() = answer.findings_reply().findings();
      return true;
    case proto::Message::kRoleShowReply:
      *status.mutable_roles() = answer.role_show_reply().roles();
      status.set_refused_announcements(answer.role_show_reply().refused_announcements());
      if (answer.role_show_reply().has_unstored()) {
        *status.mutable_unstored_roles() = answer.role_show_reply().unstored();
      }
      return true;
    default:
      return false;
  }
}

bool TakeRoles(const proto::Message& answer, proto::ControlReply& reply) {
  if (!answer.has_role_show_reply()) return false;
  *reply.mutable_roles() = answer.role_show_reply();
  return true;
}

// SyncActor's and ReplicaActor's together.
bool TakeShareStatus(const proto::Message& answer, proto::ControlReply& reply) {
  if (!answer.has_share_status()) return false;
  const proto::ShareStatus& part = answer.share_status();
  proto::ShareStatus& whole = *reply.mutable_share_status();
  whole.mutable_sessions()->MergeFrom(part.sessions());
  whole.set_received_records(whole.received_records() + part.received_records());
  whole.set_rejected_records(whole.rejected_records() + part.rejected_records());
  whole.set_damaged_messages(whole.damaged_messages() + part.damaged_messages());
  whole.set_dropped_messages(whole.dropped_messages() + part.dropped_messages());
  whole.set_refused_hellos(whole.refused_hellos() + part.refused_hellos());
  // Both actors act on these roles at least: one hears of new ones a moment before the other.
  if (!whole.has_roles() || IsNewer(whole.roles().term(), part.roles().term())) *whole.mutable_roles() = part.roles();
  whole.mutable_gathers_from()->MergeFrom(part.gathers_from());
  whole.mutable_gathers_later()->MergeFrom(part.gathers_later());
  if (part.gathers_now_from() != 0) whole.set_gathers_now_from(part.gathers_now_from());
  for (const AgentId agent : part.other_config_agents()) {
    const auto& known = whole.other_config_agents();
    if (std::find(known.begin(), known.end(), agent) == known.end()) whole.add_other_config_agents(agent);
  }
  return true;
}

// --- The table ---

constexpr Command kCommands[] = {
    {.request = Request::kStatus, .ask = AskForStatus, .take = TakeStatus},
    {.request = Request::kInsert,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckInsert(team, request.insert()); }},
    {.request = Request::kRead,
     .check = [](const Team&, AgentId, const Request& request) { return CheckRead(request.read()); },
     .ask = AskForPage},
    {.request = Request::kRoleShow, .take = TakeRoles},
    {.request = Request::kRoleSet,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckRoleSet(team, request.role_set()); },
     .text = [](const Team& team, const Request& request) { return RoleText(team, request.role_set()); },
     .take = TakeRoles},
    {.request = Request::kShare,
     .check = [](const Team& team, AgentId asked,
                 const Request& request) { return CheckShare(team, asked, request.share()); },
     .text = [](const Team& team, const Request& request) { return ShareText(team, request.share()); },
     .ask = AskToShare},
    {.request = Request::kShareStatus, .take = TakeShareStatus},
    {.request = Request::kOptimize,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckOptimize(team, request.optimize()); },
     .text = [](const Team&, const Request& request) { return OptimizeText(request.optimize()); }},
    {.request = Request::kMerge,
     .check = [](const Team& team, AgentId, const Request& request) { return CheckMerge(team, request.merge()); }},
    {.request = Request::kStop, .text = [](const Team&, const Request&) { return std::string("stop"); }},
    {.request = Request::kGraphStats},
    {.request = Request::kTrace},
    {.request = Request::kCustom, .ask = AskOwnActor},
    {.request = Request::kLease,
     .text = [](const Team&, const Request& request) { return LeaseText(request.lease()); }},
    {.request = Request::kHave, .ask = AskForHave},
    {.request = Request::kVerify},
    {.request = Request::kFingerprint},
    {.request = Request::kMapWhy,
     .check = [](const Team&, AgentId, const Request& request) { return CheckMapWhy(request.map_why()); }},
    {.request = Request::kMapStats},
    {.request = Request::kMapTiles,
     .check = [](const Team&, AgentId, const Request& request) { return CheckMapTiles(request.map_tiles()); }},
    {.request = Request::kPrune,
     .check = [](const Team&, AgentId, const Request& request) { return CheckPrune(request.prune()); },
     .text = [](const Team&, const Request& request) { return PruneText(request.prune()); }},
    {.request = Request::kDownlink,
     .text = [](const Team&, const Request& request) { return DownlinkText(request.downlink()); }},
    {.request = Request::kReadBundle},
    {.request = Request::kAcknowledge,
     .check = [](const Team&, AgentId, const Request& request) { return CheckAcknowledge(request.acknowledge()); },
     .text = [](const Team&, const Request&) { return std::string("health acknowledge"); }},
};

const Command* FindCommand(Request::RequestCase request) {
  const auto* found = std::find_if(std::begin(kCommands), std::end(kCommands),
                                   [request](const Command& command) { return command.request == request; });
  return found == std::end(kCommands) ? nullptr : found;
}

// --- By type ---

// The body of Message, or null.
const FieldDescriptor* BodyOfType(const Descriptor* type) {
  static const auto* const bodies = proto::Message::descriptor()->FindOneofByName("body");
  for (int i = 0; i < bodies->field_count(); ++i) {
    if (bodies->field(i)->message_type() == type) return bodies->field(i);
  }
  return nullptr;
}

proto::Message MessageOf(const Request& request) {
  proto::Message message;
  const FieldDescriptor* field = Request::descriptor()->FindFieldByNumber(request.request_case());
  const FieldDescriptor* body = BodyOfType(field->message_type());
  if (body == nullptr) {
    *message.mutable_control_request() = request;
  } else {
    message.GetReflection()
        ->MutableMessage(&message, body)
        ->CopyFrom(request.GetReflection()->GetMessage(request, field));
  }
  return message;
}

void CopyError(const google::protobuf::Message& part, proto::ControlReply& reply) {
  const FieldDescriptor* field = part.GetDescriptor()->FindFieldByName("error");
  if (field == nullptr || !part.GetReflection()->HasField(part, field)) return;
  const auto& error = static_cast<const proto::Error&>(part.GetReflection()->GetMessage(part, field));
  if (IsError(error)) *reply.mutable_error() = error;
}

}  // namespace

Result<void> CheckRequest(const Team& team, AgentId asked, const Request& request) {
  if (auto checked = CheckForAgent(team, request); !checked) return checked;
  const Command* command = FindCommand(request.request_case());
  if (command == nullptr) return Fail(ErrorCode::kInvalid, "holds no request that this version knows", "request");
  return command->check == nullptr ? Result<void>() : command->check(team, asked, request);
}

std::string CommandText(const Team& team, const Request& request) {
  const Command* command = FindCommand(request.request_case());
  return command == nullptr || command->text == nullptr ? "" : command->text(team, request);
}

std::vector<Question> QuestionsOf(const Request& request, bool is_relayed) {
  const Command* command = FindCommand(request.request_case());
  if (command == nullptr) return {};
  if (command->ask != nullptr) return command->ask(request, is_relayed);
  std::vector<Question> questions;
  for (const std::string& actor : CommandOptionsOf(request.request_case()).actors()) {
    questions.push_back({actor, MessageOf(request)});
  }
  return questions;
}

bool TakeAnswer(Request::RequestCase request, const proto::Message& answer, proto::ControlReply& reply) {
  if (answer.has_control_reply()) {
    reply = answer.control_reply();
    return true;
  }
  const Command* command = FindCommand(request);
  if (command != nullptr && command->take != nullptr) return command->take(answer, reply);
  const FieldDescriptor* body = proto::Message::descriptor()->FindFieldByNumber(answer.body_case());
  const FieldDescriptor* asked = Request::descriptor()->FindFieldByNumber(request);
  const FieldDescriptor* field =
      asked == nullptr ? nullptr : proto::ControlReply::descriptor()->FindFieldByName(asked->name());
  if (body == nullptr || field == nullptr || body->message_type() != field->message_type()) return false;
  const google::protobuf::Message& part = answer.GetReflection()->GetMessage(answer, body);
  reply.GetReflection()->MutableMessage(&reply, field)->CopyFrom(part);
  CopyError(part, reply);
  return true;
}

}  // namespace moondb
