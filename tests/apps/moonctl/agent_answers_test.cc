#include "apps/moonctl/agent_answers.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

AgentAnswers<int> AnswersWith(const std::vector<ErrorCode>& errors) {
  AgentAnswers<int> answers;
  answers.push_back({nullptr, 1});
  for (const ErrorCode code : errors) answers.push_back({nullptr, Fail(code, "why")});
  return answers;
}

TEST(AgentAnswersTest, ExitCodeIsThatOfTheErrorUnlessAnAgentIsUnreachable) {
  EXPECT_EQ(ExitCodeOf(AnswersWith({})), ExitCode::kDone);
  EXPECT_EQ(ExitCodeOf(AnswersWith({ErrorCode::kRefused, ErrorCode::kFull})), ExitCode::kRefused);
  EXPECT_EQ(ExitCodeOf(AnswersWith({ErrorCode::kFull})), ExitCode::kFailed);
  EXPECT_EQ(ExitCodeOf(AnswersWith({ErrorCode::kRefused, ErrorCode::kUnavailable})), ExitCode::kUnreachable);
  EXPECT_EQ(ExitCodeOf(AnswersWith({ErrorCode::kTimedOut})), ExitCode::kUnreachable);
}

TEST(AgentAnswersTest, AnAgentThatAnsweredWithAnErrorIsReachable) {
  proto::AgentConfig agent;
  agent.set_name("rover1");
  const auto shown = [&agent](ErrorCode code) {
    JsonWriter json;
    BeginAgent(AgentAnswer<int>{&agent, Fail(code, "why")}, json);
    json.EndObject();
    return std::string(json.text());
  };
  EXPECT_NE(shown(ErrorCode::kRefused).find("\"is_reachable\":true"), std::string::npos);
  EXPECT_NE(shown(ErrorCode::kRefused).find("\"error\":"), std::string::npos);
  EXPECT_NE(shown(ErrorCode::kUnavailable).find("\"is_reachable\":false"), std::string::npos);
  EXPECT_EQ(WhyNoAnswer({ErrorCode::kRefused, "why", {}}), "refused: why");
  EXPECT_EQ(WhyNoAnswer({ErrorCode::kTimedOut, "why", {}}), "unreachable: why");
}

}  // namespace
}  // namespace moondb
