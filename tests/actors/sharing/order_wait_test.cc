// Tests share requests that wait until their order is done: when the agent answers, and which progress the answer
// reports.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <random>

#include "actors/lease/lease_actor.h"
#include "model/term.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/memory_store.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::StartsWith;

constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;
constexpr AgentId kRover = 3;
constexpr AgentId kBase = 4;
constexpr std::uint64_t kRequest = 77;

// A team with records in memory: agent 1 (leader), 2 (survivor), 3 (rover) and 4 (base station).
class OrderWaitTest : public testing::Test {
 protected:
  OrderWaitTest() {
    for (AgentId agent = 1; agent <= 4; ++agent) {
      stores_[agent] = AddMemoryAgent(team_, agent, config_);
      LeaseActor::Options options;
      options.self = agent;
      options.team = config_;
      team_.Spawn(agent, actor_name::kLease, [options] { return std::make_unique<LeaseActor>(options); });
    }
    team_.AdvanceTime(seconds(1));
    // Agent 1 begins to lead in term 1.
    for (AgentId agent = 1; agent <= 4; ++agent) NotifyRoles(team_, config_, agent, Roles(kLeader, kSurvivor, 1));
    team_.AdvanceTime(seconds(10));
  }

  void InsertAt(AgentId agent, int count) {
    for (int i = 0; i < count; ++i) stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, Noise(100));
  }

  // Returns random bytes, which do not compress.
  std::string Noise(std::size_t bytes) {
    std::string noise(bytes, '\0');
    for (char& byte : noise) byte = static_cast<char>(random_());
    return noise;
  }

  void Ask(AgentId agent, double wait_s, proto::SharingKind kind = proto::SHARING_KIND_SYNC,
           const std::function<void(proto::ShareRequest&)>& change = {}) {
    proto::Message order = ShareOrder(kind);
    order.set_request_id(kRequest);
    order.mutable_share_request()->set_wait_s(wait_s);
    if (change) change(*order.mutable_share_request());
    const char* actor = kind == proto::SHARING_KIND_SYNC ? actor_name::kSync : actor_name::kReplica;
    ASSERT_EQ(team_.Post({agent, "client"}, {agent, actor}, order), SendResult::kAccepted);
  }

  // Returns the answer that the client at `agent` has received, or nothing if no answer has arrived yet.
  std::optional<proto::ShareReply> AnswerAt(AgentId agent) {
    for (const proto::Message& message : team_.TakeMessages({agent, "client"})) {
      if (message.has_share_reply()) {
        EXPECT_EQ(message.request_id(), kRequest);
        answers_[agent] = message.share_reply();
      }
    }
    return answers_[agent];
  }

  // Runs the team until the client at `agent` receives its answer, and returns the answer. Fails the test if no answer
  // arrives within `limit`.
  proto::ShareReply Await(AgentId agent, seconds limit) {
    EXPECT_TRUE(team_.RunUntil([&] { return AnswerAt(agent).has_value(); }, limit));
    return AnswerAt(agent).value_or(proto::ShareReply());
  }

  static proto::PairProgress PairOf(const proto::ShareReply& reply, AgentId sender, AgentId destination) {
    for (const proto::PairProgress& pair : reply.progress().pairs()) {
      if (pair.sender() == sender && pair.destination() == destination) return pair;
    }
    ADD_FAILURE() << "no pair of " << sender << " and " << destination;
    return {};
  }

  void Drive(AgentId agent, double for_s) {
    proto::Message lease;
    lease.mutable_lease_request()->set_kind(proto::LEASE_KIND_DRIVING);
    lease.mutable_lease_request()->set_seconds(for_s);
    (void)team_.Post({agent, actor_name::kGateway}, {agent, actor_name::kLease}, lease);
    team_.AdvanceTime(seconds(1));
  }

  proto::TeamConfig config_ = [] {
    proto::TeamConfig config = TestTeam(3);
    config.mutable_radio()->set_quiet_while_driving(true);
    return config;
  }();
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  std::map<AgentId, std::optional<proto::ShareReply>> answers_;
  std::mt19937_64 random_{1};
  simulation::SimulatedTeam team_{1};
};

TEST_F(OrderWaitTest, IsAnsweredWhenEachPairIsComplete) {
  InsertAt(kSurvivor, 50);
  InsertAt(kRover, 200);
  team_.radio().bytes_per_second = 3'000;
  Ask(kLeader, 600);
  bool was_early = false;
  EXPECT_TRUE(team_.RunUntil(
      [&] {
        const bool is_answered = AnswerAt(kLeader).has_value();
        was_early = was_early || (is_answered && stores_[kLeader]->records().size() < 250);
        return is_answered;
      },
      seconds(600)));
  EXPECT_FALSE(was_early);
  const proto::ShareReply reply = *AnswerAt(kLeader);
  EXPECT_FALSE(IsError(reply.error())) << reply.error().text();
  EXPECT_TRUE(reply.progress().is_complete());
  EXPECT_TRUE(reply.progress().is_over());
  EXPECT_EQ(reply.progress().pairs_size(), 6);
  EXPECT_EQ(reply.progress().term().number(), 1u);
  EXPECT_EQ(stores_[kBase]->records().size(), 250u) << "the leader has brought on what it was brought";
}

TEST_F(OrderWaitTest, NamesAnUnreachableAgentAndDoesNotCountItAsComplete) {
  InsertAt(kRover, 5);
  InsertAt(kSurvivor, 5);
  team_.SetLink(kLeader, kRover, false);
  Ask(kLeader, 600);
  const proto::ShareReply reply = Await(kLeader, seconds(20));
  EXPECT_TRUE(reply.progress().is_over());
  EXPECT_FALSE(reply.progress().is_complete());
  for (const auto& [sender, destination] : {std::pair(kRover, kLeader), std::pair(kLeader, kRover)}) {
    const proto::PairProgress pair = PairOf(reply, sender, destination);
    EXPECT_FALSE(pair.is_complete());
    EXPECT_TRUE(pair.is_stopped());
    EXPECT_TRUE(pair.is_out_of_reach());
    EXPECT_EQ(pair.why(), "is out of reach");
  }
  EXPECT_TRUE(PairOf(reply, kSurvivor, kLeader).is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 5u);
}

TEST_F(OrderWaitTest, WaitsForALinkThatReturnsSoon) {
  InsertAt(kRover, 5);
  team_.SetLink(kLeader, kRover, false);
  Ask(kLeader, 600);
  team_.AdvanceTime(seconds(3));
  EXPECT_FALSE(AnswerAt(kLeader));
  team_.SetLink(kLeader, kRover, true);
  EXPECT_TRUE(Await(kLeader, seconds(20)).progress().is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 5u);
}

TEST_F(OrderWaitTest, WaitsForAnAgentThatDrivesUntilItsLimit) {
  InsertAt(kRover, 5);
  Drive(kRover, 40);
  Ask(kLeader, 10);
  const proto::ShareReply late = Await(kLeader, seconds(12));
  EXPECT_FALSE(late.progress().is_over());
  EXPECT_THAT(PairOf(late, kRover, kLeader).why(), StartsWith("rover3 drives for"));
  EXPECT_NEAR(PairOf(late, kRover, kLeader).waits_for_s(), 29, 2);
  answers_.clear();
  Ask(kLeader, 600);
  EXPECT_TRUE(Await(kLeader, seconds(60)).progress().is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 5u);
}

TEST_F(OrderWaitTest, EndsWhileTheRobotKeepsInserting) {
  InsertAt(kRover, 100);
  team_.radio().bytes_per_second = 3'000;
  Ask(kRover, 60);
  for (int i = 0; i < 1200 && !AnswerAt(kRover); ++i) {
    // Inserts 8 kB/s, but the radio carries only 3 kB/s.
    stores_[kRover]->Insert(kRover, proto::LOCAL_TRAVERSABILITY_MAP, Noise(400));
    team_.AdvanceTime(milliseconds(50));
  }
  const auto reply = AnswerAt(kRover);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->progress().is_complete());
  EXPECT_GE(stores_[kLeader]->records().size(), 100u);
}

TEST_F(OrderWaitTest, ARestartedAgentReceivesTheOrderAgain) {
  InsertAt(kRover, 300);
  team_.radio().bytes_per_second = 3'000;
  Ask(kLeader, 600);
  team_.AdvanceTime(seconds(1));
  ASSERT_LT(stores_[kLeader]->records().size(), 300u);
  team_.SetLink(kLeader, kRover, false);
  team_.Crash(kRover);
  team_.AdvanceTime(seconds(1));
  team_.Restart(kRover);
  team_.SetLink(kLeader, kRover, true);
  EXPECT_TRUE(Await(kLeader, seconds(120)).progress().is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 300u);
}

TEST_F(OrderWaitTest, EndsWithItsTerm) {
  InsertAt(kRover, 100);
  team_.radio().bytes_per_second = 1'000;
  Ask(kLeader, 600);
  team_.AdvanceTime(seconds(1));
  NotifyRoles(team_, config_, kLeader, Roles(kSurvivor, kLeader, 2));
  const proto::ShareReply reply = Await(kLeader, seconds(1));
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(reply.error().field(), "expected_term");
  EXPECT_THAT(reply.error().text(), StartsWith("leadership moved to rover2 in term 2"));
  EXPECT_FALSE(reply.progress().is_complete());
}

TEST_F(OrderWaitTest, IsNotCompleteBeforeTheRecordsThatANewLeaderGathersAreForwarded) {
  stores_[kSurvivor]->Insert(kLeader, proto::POSE_GRAPH_NODE, "what the leader lost with its disk");
  for (int i = 0; i < 50; ++i) stores_[kSurvivor]->Insert(kRover, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
  team_.radio().bytes_per_second = 2'000;
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, kSurvivor, 2));
  Ask(kLeader, 600);
  const proto::ShareReply reply = Await(kLeader, seconds(120));
  EXPECT_TRUE(reply.progress().is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 51u);
  EXPECT_EQ(stores_[kBase]->records().size(), 51u);
  int gathered = 0;
  for (const proto::PairProgress& pair : reply.progress().pairs()) {
    gathered += pair.kind() == proto::SHARING_KIND_REPLICATION ? 1 : 0;
  }
  EXPECT_EQ(gathered, 3);
}

TEST_F(OrderWaitTest, AReplicationIsCompleteWhenTheSurvivorHasTheGatheredRecords) {
  for (int i = 0; i < 50; ++i) stores_[kBase]->Insert(kRover, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
  team_.radio().bytes_per_second = 2'000;
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, kSurvivor, 2));
  Ask(kLeader, 600, proto::SHARING_KIND_REPLICATION);
  EXPECT_TRUE(Await(kLeader, seconds(120)).progress().is_complete());
  EXPECT_EQ(stores_[kSurvivor]->records().size(), 50u);
}

TEST_F(OrderWaitTest, AnAgentThatRefusesToShareDoesNotCountAsGathered) {
  std::uint64_t order = 0;
  team_.SetFilter([&order](AgentId, AgentId to, const proto::Message& message) {
    if (to != kRover || !message.has_share_request()) return true;
    order = message.request_id();
    return false;
  });
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, kSurvivor, 2));
  ASSERT_TRUE(team_.RunUntil([&] { return order != 0; }, seconds(60)));
  proto::Message refusal;
  refusal.set_request_id(order);
  refusal.mutable_share_reply()->mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_share_reply()->mutable_error()->set_text("does not share");
  (void)team_.Post({kRover, actor_name::kReplica}, {kLeader, actor_name::kReplica}, refusal);
  team_.AdvanceTime(seconds(5));
  Ask(kLeader, 20, proto::SHARING_KIND_REPLICATION);
  const proto::ShareReply reply = Await(kLeader, seconds(22));
  EXPECT_FALSE(reply.progress().is_complete());
  EXPECT_EQ(PairOf(reply, kRover, kLeader).why(), "does not share");
}

// The rover is still carrying out an order of term 1 when the leader begins term 2. That order covers only the 300
// records that the rover held when the order arrived, so it does not complete the gathering in term 2.
TEST_F(OrderWaitTest, AnEarlierOrderDoesNotCountAsGathering) {
  InsertAt(kRover, 300);
  team_.radio().bytes_per_second = 3'000;
  proto::Message earlier = ShareOrder(proto::SHARING_KIND_REPLICATION, kLeader);
  (void)team_.Post({kRover, "operator"}, {kRover, actor_name::kReplica}, earlier);
  team_.AdvanceTime(seconds(1));
  InsertAt(kRover, 50);
  // While `is_deaf` is true, the rover receives no orders.
  bool is_deaf = true;
  team_.SetFilter([&is_deaf](AgentId, AgentId to, const proto::Message& message) {
    return !is_deaf || to != kRover || !message.has_share_request();
  });
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, kSurvivor, 2));
  Ask(kLeader, 600, proto::SHARING_KIND_REPLICATION);
  EXPECT_TRUE(team_.RunUntil([&] { return stores_[kLeader]->records().size() == 300; }, seconds(60)));
  team_.AdvanceTime(seconds(5));
  EXPECT_FALSE(AnswerAt(kLeader));
  is_deaf = false;
  EXPECT_TRUE(Await(kLeader, seconds(300)).progress().is_complete());
  EXPECT_EQ(stores_[kLeader]->records().size(), 350u);
}

TEST_F(OrderWaitTest, NamesAnAgentWhoseRecordsCannotBeRequested) {
  Drive(kRover, 300);
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, kSurvivor, 2));
  Ask(kLeader, 5, proto::SHARING_KIND_REPLICATION);
  const proto::ShareReply reply = Await(kLeader, seconds(7));
  EXPECT_TRUE(reply.progress().is_over()) << "nothing more can be gathered now";
  EXPECT_FALSE(reply.progress().is_complete());
  EXPECT_TRUE(PairOf(reply, kLeader, kSurvivor).is_complete());
  EXPECT_THAT(PairOf(reply, kRover, kLeader).why(), StartsWith("rover3 drives"));
}

TEST_F(OrderWaitTest, StopsWhenItsBytesAreUsedUp) {
  InsertAt(kRover, 2000);
  Ask(kLeader, 600, proto::SHARING_KIND_SYNC, [](proto::ShareRequest& request) {
    request.set_bytes_max(2'000);
    request.add_from_agents(kRover);
  });
  const proto::ShareReply reply = Await(kLeader, seconds(20));
  ASSERT_EQ(reply.progress().pairs_size(), 1);
  EXPECT_TRUE(reply.progress().is_over());
  EXPECT_TRUE(reply.progress().pairs(0).is_limited());
  EXPECT_FALSE(reply.progress().pairs(0).is_complete());
  EXPECT_GT(stores_[kLeader]->records().size(), 0u);
  EXPECT_LT(stores_[kLeader]->records().size(), 2000u);
}

TEST_F(OrderWaitTest, ResendsTheEndOfALimitedOrderIfItWasLost) {
  InsertAt(kRover, 2000);
  int ends = 0;
  team_.SetFilter([&ends](AgentId, AgentId to, const proto::Message& message) {
    return to != kLeader || !message.batch().order_end().is_limited() || ++ends > 2;
  });
  Ask(kLeader, 600, proto::SHARING_KIND_SYNC, [](proto::ShareRequest& request) {
    request.set_bytes_max(2'000);
    request.add_from_agents(kRover);
  });
  EXPECT_TRUE(Await(kLeader, seconds(60)).progress().pairs(0).is_limited());
}

TEST_F(OrderWaitTest, ReportsRecordsThatADestinationRejected) {
  InsertAt(kRover, 3);
  for (int i = 0; i < 4; ++i) stores_[kRover]->Insert(kRover, proto::LOCAL_TRAVERSABILITY_MAP, "map");
  stores_[kLeader]->Reject(proto::LOCAL_TRAVERSABILITY_MAP);
  Ask(kLeader, 600);
  const proto::PairProgress pair = PairOf(Await(kLeader, seconds(60)), kRover, kLeader);
  EXPECT_FALSE(pair.is_complete());
  EXPECT_TRUE(pair.is_stopped());
  EXPECT_EQ(pair.why(), "the destination did not accept 4 records");
}

TEST_F(OrderWaitTest, ARoverWaitsOnlyForItsOwnRecords) {
  InsertAt(kRover, 5);
  Ask(kRover, 60);
  const proto::ShareReply reply = Await(kRover, seconds(10));
  ASSERT_EQ(reply.progress().pairs_size(), 1);
  EXPECT_TRUE(reply.progress().is_complete());
  EXPECT_EQ(reply.progress().pairs(0).destination(), kLeader);
}

TEST_F(OrderWaitTest, AWaitCausesNoExtraMessagesBetweenAgents) {
  std::map<bool, int> messages;
  for (const bool is_waiting : {false, true}) {
    int& count = messages[is_waiting];
    team_.SetFilter([&count](AgentId, AgentId, const proto::Message&) {
      ++count;
      return true;
    });
    InsertAt(kRover, 20);
    answers_.clear();
    Ask(kLeader, is_waiting ? 60 : 0);
    team_.AdvanceTime(seconds(20));
    EXPECT_TRUE(AnswerAt(kLeader));
    team_.SetFilter({});
  }
  EXPECT_EQ(messages[true], messages[false]);
}

// --- News about an order ---

class OrderNewsTest : public OrderWaitTest {
 protected:
  std::uint64_t Order() { return Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order(); }

  void RequestChanges(std::uint64_t order, std::uint64_t after_version, double wait_s, bool is_relayed = false) {
    proto::Message question;
    proto::ShareProgressRequest& request = *question.mutable_share_progress_request();
    request.set_kind(proto::SHARING_KIND_SYNC);
    request.set_order(order);
    request.set_after_version(after_version);
    request.set_wait_s(wait_s);
    request.set_is_relayed(is_relayed);
    (void)team_.Post({kLeader, "news"}, {kLeader, actor_name::kSync}, question);
  }

  std::optional<proto::ShareProgress> News(std::chrono::nanoseconds limit) {
    const auto message = team_.Expect({kLeader, "news"}, proto::Message::kShareProgress, limit);
    return message ? std::optional(message->share_progress()) : std::nullopt;
  }
};

TEST_F(OrderNewsTest, ArrivesAtMostTwicePerSecondAndOverTheRadioOnceInFiveSeconds) {
  InsertAt(kRover, 500);
  team_.radio().bytes_per_second = 3'000;
  for (const bool is_relayed : {false, true}) {
    const std::uint64_t order = Order();
    RequestChanges(order, 0, 60, is_relayed);
    auto news = News(milliseconds(100));
    ASSERT_TRUE(news) << "the first news comes at once";
    EXPECT_EQ(news->order(), order);
    EXPECT_FALSE(news->is_over());
    RequestChanges(order, news->version(), 60, is_relayed);
    EXPECT_FALSE(News(is_relayed ? milliseconds(4900) : milliseconds(400)));
    const auto next = News(milliseconds(700));
    ASSERT_TRUE(next);
    EXPECT_GT(next->version(), news->version());
  }
}

TEST_F(OrderNewsTest, ReportsTheEnd) {
  InsertAt(kRover, 100);
  const std::uint64_t order = Order();
  std::uint64_t version = 0;
  for (int i = 0; i < 100; ++i) {
    RequestChanges(order, version, 60);
    const auto news = News(seconds(61));
    ASSERT_TRUE(news);
    EXPECT_GT(news->version(), version);
    version = news->version();
    if (!news->is_over()) continue;
    EXPECT_TRUE(news->is_complete());
    EXPECT_EQ(stores_[kLeader]->records().size(), 100u);
    return;
  }
  FAIL() << "it is never over";
}

TEST_F(OrderNewsTest, ArrivesUnchangedAfterTheWaitIfNothingChanged) {
  Drive(kRover, 3600);
  InsertAt(kRover, 1);
  const std::uint64_t order = Order();
  team_.AdvanceTime(seconds(5));
  RequestChanges(order, UINT64_MAX, 2);
  EXPECT_FALSE(News(milliseconds(1900)));
  EXPECT_TRUE(News(milliseconds(200)));
}

TEST_F(OrderNewsTest, AboutAnUnknownOrderIsAnError) {
  RequestChanges(12345, 0, 60);
  const auto news = News(milliseconds(100));
  ASSERT_TRUE(news);
  EXPECT_EQ(news->error().code(), proto::ERROR_CODE_NOT_FOUND);
}

TEST_F(OrderNewsTest, ForgetsOldOrdersExceptThoseWithAWaitingClient) {
  InsertAt(kRover, 2000);
  team_.radio().bytes_per_second = 1'000;
  const std::uint64_t waited_for = Order();
  const std::uint64_t forgotten = Order();
  RequestChanges(waited_for, UINT64_MAX, 60);
  for (int i = 0; i < 40; ++i) (void)Order();
  RequestChanges(forgotten, 0, 60);
  EXPECT_EQ(News(milliseconds(100)).value().error().code(), proto::ERROR_CODE_NOT_FOUND);
  const auto news = News(seconds(61));
  ASSERT_TRUE(news);
  EXPECT_FALSE(IsError(news->error()));
  EXPECT_EQ(news->order(), waited_for);
}

TEST_F(OrderNewsTest, RefusesTooManyRequests) {
  Drive(kRover, 3600);
  InsertAt(kRover, 1);
  const std::uint64_t order = Order();
  for (int i = 0; i < 65; ++i) RequestChanges(order, UINT64_MAX, 60);
  const auto refused = News(seconds(1));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->error().code(), proto::ERROR_CODE_FULL);
}

}  // namespace
}  // namespace moondb
