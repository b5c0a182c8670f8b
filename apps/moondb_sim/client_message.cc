#include "apps/moondb_sim/client_message.h"

#include <algorithm>

#include "model/control_message.h"
#include "model/control_request.h"

namespace moondb::simulation {
namespace {

// Longest time that a request and its answer may spend on the radio and in mailboxes.
constexpr Duration kOnTheWay = std::chrono::seconds(2);

}  // namespace

proto::Message ClientMessage(std::uint64_t request_id, const proto::ControlRequest& request) {
  proto::Message message = MessageOf(request);
  message.set_request_id(request_id);
  message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
  return message;
}

std::optional<proto::ControlReply> ClientReplyIn(const proto::Message& message) {
  Result<proto::ControlReply> reply = ControlReplyOf(message);
  return reply ? std::optional(*std::move(reply)) : std::nullopt;
}

Duration AnsweredWithin(const proto::ControlRequest& request, Duration timeout, Duration long_timeout) {
  const Duration waits = std::chrono::duration_cast<Duration>(WaitOf(request));
  return (TakesLong(request) ? long_timeout : waits + timeout) + kOnTheWay;
}

std::string NameOf(const proto::ControlRequest& request) {
  const auto* field = proto::ControlRequest::descriptor()->FindFieldByNumber(request.request_case());
  std::string name = field == nullptr ? "nothing" : field->name();
  if (request.for_agent() != 0) name += " for agent " + std::to_string(request.for_agent());
  return name;
}

std::optional<HaveSet> HaveInAnswer(const proto::Message& message) {
  if (message.body_case() != proto::Message::kControlReply || message.source_actor() != actor_name::kRetention)
    return std::nullopt;
  const Result<proto::ControlReply> reply = ControlReplyOf(message);
  if (!reply || !reply->has_have()) return std::nullopt;
  const Result<HaveSet> have = FromProto(reply->have().have());
  return have ? std::optional(*have) : std::nullopt;
}

}  // namespace moondb::simulation
