// What several agents answered to one question, as commands show it: each that was asked stands there, if only with why
// it did not answer.
#pragma once

#include <algorithm>
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

// kUnreachable where one did not answer.
template <typename T>
ExitCode ExitCodeOf(const AgentAnswers<T>& answers) {
  const bool are_all_there =
      std::all_of(answers.begin(), answers.end(), [](const auto& one) { return one.answer.has_value(); });
  return are_all_there ? ExitCode::kDone : ExitCode::kUnreachable;
}

// Begins one agent's object: its name, whether it answered, and the error if not.
template <typename T>
void BeginAgent(const AgentAnswer<T>& asked, JsonWriter& json) {
  json.BeginObject().Key("name").String(asked.agent->name()).Key("is_reachable").Bool(asked.answer.has_value());
  if (!asked.answer) json.Key("error").WriteError(asked.answer.error());
}

// For people, in place of an answer.
inline std::string Unreachable(const Error& error) { return "unreachable: " + ToString(error); }

}  // namespace moondb
