// Tests that requests for pages of one client with a key, or of another agent, take turns, and that a client that does
// not read its answers is refused further ones.
#include <gmock/gmock.h>

#include "actors/gateway/gateway_actor.h"
#include "actors/gateway/request_check.h"
#include "model/control_message.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;

constexpr std::uint64_t kMiB = 1024 * 1024;

// Agent 1 runs only GatewayActor. The tests are its clients, its StorageActor and the gateway of agent 2.
class PageRequestsTest : public testing::Test {
 protected:
  PageRequestsTest() {
    GatewayActor::Options options;
    options.self = 1;
    options.team.set_team("test");
    options.team.set_team_id("00112233445566778899aabbccddeeff");
    for (const std::uint32_t id : {1, 2}) {
      proto::AgentConfig& agent = *options.team.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      team_.AddAgent(id);
    }
    options.unread_bytes = [this](const std::string& connection) { return unread_bytes_[connection]; };
    team_.Spawn(1, actor_name::kGateway, [options] { return std::make_unique<GatewayActor>(options); });
  }

  static proto::ControlRequest Read(std::uint32_t content_bytes_max = 8 * kMiB, double wait_s = 0) {
    proto::ControlRequest request;
    request.mutable_read()->set_content_bytes_max(content_bytes_max);
    request.mutable_read()->set_wait_s(wait_s);
    request.mutable_read()->set_after_row_id(7);
    return request;
  }

  // Sends a request of the client with the key `key_name` over `connection`; without a key, over ipc.
  void Ask(const std::string& connection, const std::string& key_name, std::uint64_t id,
           const proto::ControlRequest& request = Read()) {
    proto::Message message = MessageOf(request);
    message.set_request_id(id);
    message.set_client_rights(key_name.empty() ? proto::CLIENT_RIGHTS_COMMAND : proto::CLIENT_RIGHTS_VIEW);
    message.set_client_name(key_name);
    ASSERT_EQ(team_.Post({kClients, connection}, gateway_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  // Returns the requests that StorageActor received since the last call.
  std::vector<proto::Message> Asked() { return team_.TakeMessages({1, actor_name::kStorage}); }

  void AnswerPage(const proto::Message& asked, int records = 1) {
    proto::Message page;
    page.mutable_read_reply()->set_is_complete(true);
    for (int i = 0; i < records; ++i) {
      page.mutable_read_reply()->add_records();
      page.mutable_read_reply()->add_row_ids(8 + i);
    }
    page.set_request_id(asked.request_id());
    (void)team_.Post({1, actor_name::kStorage}, gateway_, page);
    team_.RunUntilIdle();
  }

  // Returns the ids and the error texts of the answers to `connection` since the last call.
  std::map<std::uint64_t, std::string> Answers(const std::string& connection) {
    std::map<std::uint64_t, std::string> answers;
    for (const proto::Message& message : team_.TakeMessages({kClients, connection})) {
      answers[message.request_id()] = ControlReplyOf(message)->error().text();
    }
    return answers;
  }

  const Address gateway_{1, actor_name::kGateway};
  std::map<std::string, std::uint64_t> unread_bytes_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(PageRequestsTest, OnePageOfAKeyIsReadAtATime) {
  Ask("k1", "anna", 1);
  Ask("k2", "anna", 2);
  Ask("k1", "anna", 3);
  std::vector<proto::Message> asked = Asked();
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(asked.front().read_request().content_bytes_max(), kKeyedContentBytesMax);
  for (const auto& [connection, id] : std::map<std::string, std::uint64_t>{{"k1", 1}, {"k2", 2}}) {
    AnswerPage(asked.front());
    EXPECT_EQ(Answers(connection), (std::map<std::uint64_t, std::string>{{id, ""}}));
    asked = Asked();
    ASSERT_EQ(asked.size(), 1u);
  }
  AnswerPage(asked.front());
  EXPECT_EQ(Answers("k1"), (std::map<std::uint64_t, std::string>{{3, ""}}));
  EXPECT_TRUE(Asked().empty());
}

TEST_F(PageRequestsTest, OtherKeysAndClientsOverIpcDoNotWait) {
  Ask("k1", "anna", 1);
  Ask("k2", "bert", 2);
  for (std::uint64_t id = 3; id <= 5; ++id) Ask("1", "", id);
  EXPECT_EQ(Asked().size(), 5u);
}

TEST_F(PageRequestsTest, TheRequestsOfAnotherAgentTakeTurns) {
  for (const char* actor : {"asker1", "asker2"}) {
    proto::ControlRequest request = Read();
    request.set_for_agent(1);
    (void)team_.Post({2, actor}, gateway_, MessageOf(request));
    team_.AdvanceTime(seconds(1));
  }
  const std::vector<proto::Message> asked = Asked();
  ASSERT_EQ(asked.size(), 1u);
  AnswerPage(asked.front());
  EXPECT_EQ(Asked().size(), 1u);
}

TEST_F(PageRequestsTest, ATimeoutEndsATurn) {
  Ask("k1", "anna", 1);
  team_.AdvanceTime(seconds(30));
  Ask("k1", "anna", 2);
  EXPECT_EQ(Asked().size(), 1u);
  team_.AdvanceTime(seconds(31));
  EXPECT_THAT(Answers("k1")[1], HasSubstr("storage did not answer in time"));
  const std::vector<proto::Message> asked = Asked();
  ASSERT_EQ(asked.size(), 1u);
  AnswerPage(asked.front());
  EXPECT_EQ(Answers("k1"), (std::map<std::uint64_t, std::string>{{2, ""}}));
}

TEST_F(PageRequestsTest, ARestartOfStorageEndsTheTurnAndBeginsTheNext) {
  class SilentActor final : public Actor {
    void OnMessage(Context&, const proto::Message&) override {}
  };
  team_.Spawn(1, actor_name::kStorage, [] { return std::make_unique<SilentActor>(); });
  team_.RunUntilIdle();
  Ask("k1", "anna", 1);
  Ask("k2", "anna", 2);
  Ask("1", "", 3);
  team_.CrashActor({1, actor_name::kStorage});
  team_.RunUntilIdle();
  EXPECT_EQ(Answers("k1")[1], "storage restarted before it answered; ask again");
  EXPECT_TRUE(Answers("k2").empty()) << "the request was sent to storage after the restart";
  team_.CrashActor({1, actor_name::kStorage});
  team_.RunUntilIdle();
  EXPECT_EQ(Answers("k2")[2], "storage restarted before it answered; ask again");
}

TEST_F(PageRequestsTest, ARequestThatWaitsForItsTurnTimesOut) {
  Ask("k1", "anna", 1);
  const std::vector<proto::Message> first = Asked();
  for (std::uint64_t id = 2; id <= 3; ++id) Ask("k1", "anna", id);
  team_.AdvanceTime(seconds(61));
  EXPECT_EQ(Answers("k1").size(), 3u);
  Ask("k1", "anna", 4);
  ASSERT_EQ(first.size(), 1u);
  AnswerPage(first.front());  // This answer is late.
  EXPECT_TRUE(Answers("k1").empty());
  for (const proto::Message& asked : Asked()) AnswerPage(asked);
  EXPECT_EQ(Answers("k1"), (std::map<std::uint64_t, std::string>{{4, ""}}));
}

TEST_F(PageRequestsTest, AFeedThatWaitsForRecordsHoldsNoTurn) {
  Ask("k1", "anna", 1, Read(kMiB, /*wait_s=*/30));
  AnswerPage(Asked().at(0), /*records=*/0);
  Ask("k2", "anna", 2);
  const std::vector<proto::Message> page = Asked();
  ASSERT_EQ(page.size(), 1u);
  proto::Message stored;
  stored.mutable_records_stored()->set_last_row_id(8);
  (void)team_.Post({1, actor_name::kStorage}, gateway_, stored);
  team_.RunUntilIdle();
  EXPECT_TRUE(Asked().empty()) << "the feed reads again after the page";
  AnswerPage(page.front());
  const std::vector<proto::Message> again = Asked();
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again.front().read_request().after_row_id(), 7u);
  AnswerPage(again.front());
  EXPECT_EQ(Answers("k1"), (std::map<std::uint64_t, std::string>{{1, ""}}));
}

TEST_F(PageRequestsTest, AKeyThatDoesNotReadIsRefusedAtOnce) {
  unread_bytes_["k1"] = 12 * kMiB + 1;
  Ask("k1", "anna", 1);
  EXPECT_THAT(Answers("k1")[1], HasSubstr("read those answers"));
  EXPECT_TRUE(Asked().empty());
  Ask("k1", "anna", 2, Read(kMiB));
  EXPECT_EQ(Asked().size(), 1u);
  unread_bytes_["k1"] = 16 * kMiB;
  proto::ControlRequest status;
  status.mutable_status();
  Ask("k1", "anna", 3, status);
  EXPECT_THAT(Answers("k1")[3], HasSubstr("read those answers"));
  Ask("1", "", 4);
  EXPECT_EQ(Asked().size(), 1u) << "clients over ipc have no limit of bytes";
}

TEST_F(PageRequestsTest, ARelayedRequestCountsWithTheLargestAnswerOverTheRadio) {
  proto::ControlRequest request;
  request.mutable_merge();
  request.set_for_agent(2);
  for (std::uint64_t id = 1; id <= 8; ++id) Ask("k1", "anna", id, request);
  EXPECT_TRUE(Answers("k1").empty());
}

TEST_F(PageRequestsTest, TheBytesAreCheckedAgainWhenTheTurnBegins) {
  for (std::uint64_t id = 1; id <= 4; ++id) Ask("k1", "anna", id);
  unread_bytes_["k1"] = 14 * kMiB;
  AnswerPage(Asked().at(0));
  const std::map<std::uint64_t, std::string> answers = Answers("k1");
  ASSERT_EQ(answers.size(), 4u);
  EXPECT_EQ(answers.at(1), "");
  for (std::uint64_t id = 2; id <= 4; ++id) EXPECT_THAT(answers.at(id), HasSubstr("read those answers")) << id;
  EXPECT_TRUE(Asked().empty());
  unread_bytes_["k1"] = 0;
  Ask("k1", "anna", 5);
  EXPECT_EQ(Asked().size(), 1u);
}

}  // namespace
}  // namespace moondb
