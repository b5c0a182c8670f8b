// Checks, logs and dispatches client requests. proto/control.proto declares the actors that answer a request, the
// rights that the request needs, and whether the request takes long.
//
// Rules for a request without a row in command_table.cc:
// - The request has no validation rule.
// - The request is logged, by its name, if it needs the right `command`.
// - The actor receives the field of Message.body that has the request's type. The answer goes into the field of
//   ControlReply that has the answer's type.
// - If Message.body has no such field, or several actors answer, the actors receive the ControlRequest and answer with
//   ControlReplies, which are merged.
//
// Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Checks a request. `asked`: the agent that must answer the request. Returns kInvalid, with the field, for an unknown
// request, for a request to an agent outside the team, and for a violation of the request's own rule
// (actors/gateway/request_check.h).
Result<void> CheckRequest(const proto::TeamConfig& team, AgentId asked, const proto::ControlRequest& request);

// Returns the text for the event log; empty if the request is not logged (actors/gateway/command_text.h).
std::string CommandText(const proto::TeamConfig& team, const proto::ControlRequest& request);

// A message for an actor of this agent.
struct Question {
  std::string actor;
  proto::Message message;
};

// Returns the messages that the gateway must send for a checked request, in order; empty if the gateway itself answers.
// `is_relayed`: true if the answer crosses the radio.
std::vector<Question> QuestionsOf(proto::ControlRequest request, bool is_relayed);

// Merges one actor's answer to the request into the reply, and copies the answer's error to ControlReply.error. Returns
// false if the answer has the wrong type or does not decode.
bool TakeAnswer(proto::ControlRequest::RequestCase request, const proto::Message& answer, proto::ControlReply& reply);

}  // namespace moondb
