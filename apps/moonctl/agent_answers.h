// What several agents answered to one question, as commands show it: each that was asked stands there, if only with why
// it gave none.
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

// One that answered with an error, or does not let this client in, is there.
inline bool IsUnreachable(const Error& error) {
  return error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kTimedOut;
}

// kUnreachable where one did not answer; else that of the first error.
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

// Begins one agent's object: its name, whether it answered, and the error if that is what it answered, or why not.
template <typename T>
void BeginAgent(const AgentAnswer<T>& asked, JsonWriter& json) {
  const bool is_reachable = asked.answer.has_value() || !IsUnreachable(asked.answer.error());
  json.BeginObject().Key("name").String(asked.agent->name()).Key("is_reachable").Bool(is_reachable);
  if (!asked.answer) json.Key("error").WriteError(asked.answer.error());
}

// For people, in place of an answer.
inline std::string WhyNoAnswer(const Error& error) {
  if (IsUnreachable(error)) return "unreachable: " + ToString(error);
  return (error.code == ErrorCode::kRefused ? "refused: " : "failed: ") + ToString(error);
}

}  // namespace moondb
