// Dispatches client requests. For each request, proto/control.proto declares the actors that answer it, the rights that
// it needs, and whether it takes long.
//
// By default a request has no validation rule, and is logged by its name only if it needs the right `command`. Its
// actor receives it in the field of Message.body that has the request's type. The actor's answer goes into the field of
// ControlReply that has the answer's type. If Message has no such body, or several actors answer, the actors receive
// the ControlRequest itself and answer with ControlReplies, which are merged. Requests that differ from this default
// have a row in command_table.cc with functions of their own. Plain functions, usable on any thread.
#pragma once

#include <string>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Checks a request. `asked`: the agent that must answer it. Returns kInvalid, with the field, for an unknown request,
// for a request to an agent outside the team, and for a violation of the request's own rule
// (actors/gateway/request_check.h).
Result<void> CheckRequest(const proto::TeamConfig& team, AgentId asked, const proto::ControlRequest& request);

// Returns the text for the event log; empty if the request is not logged (actors/gateway/command_text.h).
std::string CommandText(const proto::TeamConfig& team, const proto::ControlRequest& request);

// A message for an actor of this agent.
struct Question {
  std::string actor;
  proto::Message message;
};

// Returns all messages that the gateway must send for a checked request, in order. Empty if the gateway itself answers.
// Moves the contents of the request into the messages, since a map may have megabytes. `is_relayed`: the answer crosses
// the radio.
std::vector<Question> QuestionsOf(proto::ControlRequest request, bool is_relayed);

// Merges one actor's answer to the request into the reply, and copies its error to ControlReply.error. Returns false if
// the answer has the wrong type or does not decode.
bool TakeAnswer(proto::ControlRequest::RequestCase request, const proto::Message& answer, proto::ControlReply& reply);

}  // namespace moondb
