// AgentAnswers: the answers of several agents to one request. Every agent that got the request has an entry. The entry
// of an agent that did not answer is an error.
#pragma once

#include <string>
#include <vector>

#include "apps/common/json_writer.h"
#include "apps/moonctl/exit_code.h"
#include "proto/team.pb.h"

namespace moondb {

template <typename T>
struct AgentAnswer {
  const proto::AgentConfig* agent = nullptr;
  Result<T> answer;
};

template <typename T>
using AgentAnswers = std::vector<AgentAnswer<T>>;

// Returns true if the error means that the agent did not answer. An agent that answered with an error, or refused this
// client, is reachable.
inline bool IsUnreachable(const Error& error) {
  return error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kTimedOut;
}

// Returns kUnreachable if any agent did not answer, otherwise the exit code of the first error. Returns kDone if there
// is no error.
template <typename T>
ExitCode ExitCodeOf(const AgentAnswers<T>& answers) {
  ExitCode code = ExitCode::kDone;
  for (const auto& [agent, answer] : answers) {
    if (answer) continue;
    if (IsUnreachable(answer.error())) return ExitCode::kUnreachable;
    if (code == ExitCode::kDone) code = ExitCodeOf(answer.error().code);
  }
  return code;
}

// Begins the JSON object of one agent: its name, whether it answered, and its error if there is one. The caller ends
// the object.
template <typename T>
void BeginAgent(const AgentAnswer<T>& asked, JsonWriter& json) {
  const bool is_reachable = asked.answer.has_value() || !IsUnreachable(asked.answer.error());
  json.BeginObject().Key("name").String(asked.agent->name()).Key("is_reachable").Bool(is_reachable);
  if (!asked.answer) json.Key("error").WriteError(asked.answer.error());
}

// Returns the text shown in place of an agent's answer: the kind of failure, and the error.
inline std::string WhyNoAnswer(const Error& error) {
  if (IsUnreachable(error)) return "unreachable: " + ToString(error);
  return (error.code == ErrorCode::kRefused ? "refused: " : "failed: ") + ToString(error);
}

}  // namespace moondb
