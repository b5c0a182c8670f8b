// What becomes of each request of a client. Its row stands in proto/control.proto, at the request itself: who answers,
// the right that is needed, whether it takes long.
//
// As usual a request is not looked into, is written down by its name if it needs the right `command` and else not at
// all, goes to its actor as the body of Message that has its type, and what that answers is put into ControlReply by
// its type. Where Message has no such body, or several actors answer, the ControlRequest itself goes to them, and they
// answer with ControlReplies, which are merged. What is not as usual has a row in command_table.cc, with functions of
// its own. Plain functions, any thread.
#pragma once

#include <string>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// `asked` is the agent that the request is for. kInvalid, with the field named: no request that this version knows, one
// for an agent that is not of the team, and what the request's own rule refuses (actors/gateway/request_check.h).
Result<void> CheckRequest(const proto::TeamConfig& team, AgentId asked, const proto::ControlRequest& request);

// For the event log; empty: nothing is written down (actors/gateway/command_text.h).
std::string CommandText(const proto::TeamConfig& team, const proto::ControlRequest& request);

// What an actor of this agent is asked.
struct Question {
  std::string actor;
  proto::Message message;
};

// All that a checked request makes the gateway ask, in order; empty: it answers by itself. What the request holds moves
// into the questions: it may be a map of megabytes. `is_relayed`: the answer crosses the radio.
std::vector<Question> QuestionsOf(proto::ControlRequest request, bool is_relayed);

// Puts one actor's answer to such a request into the reply, an error of it into the reply's own too. False for what is
// no answer to it, and for what does not decode.
bool TakeAnswer(proto::ControlRequest::RequestCase request, const proto::Message& answer, proto::ControlReply& reply);

}  // namespace moondb
