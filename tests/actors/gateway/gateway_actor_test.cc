#include "actors/gateway/gateway_actor.h"

#include <gmock/gmock.h>

#include "actors/gateway/request_check.h"
#include "model/control_message.h"
#include "model/record_check.h"
#include "model/team_id.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;

// Agent 1 runs only GatewayActor. The tests send the messages of its other actors, and read the messages that
// GatewayActor sends to them.
class GatewayActorTest : public testing::Test {
 protected:
  explicit GatewayActorTest(bool has_base = false) {
    team_config_.set_team("test");
    team_config_.set_team_id("00112233445566778899aabbccddeeff");
    for (const std::uint32_t id : {1, 2}) {
      proto::AgentConfig& agent = *team_config_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      team_.AddAgent(id);
    }
    if (has_base) {
      proto::AgentConfig& base = *team_config_.add_agents();
      base.set_id(3);
      base.set_name("base");
      base.set_kind(proto::AGENT_KIND_BASE_STATION);
      team_.AddAgent(3);
    }
    SpawnGateway(1);
  }

  void SpawnGateway(AgentId agent, std::size_t relay_bytes_max = 20'000) {
    GatewayActor::Options options;
    options.self = agent;
    options.team = team_config_;
    options.config_hash = 40 + agent;
    options.version = "1.2.3";
    options.pid = 77;
    options.merge_backend = [] { return "cpu"; };
    options.pending_max = 4;
    options.waits_max = 2;
    options.own_actors = {"soil"};
    options.relay_bytes_max = relay_bytes_max;
    team_.Spawn(agent, actor_name::kGateway, [options] { return std::make_unique<GatewayActor>(options); });
  }

  void Request(const proto::ControlRequest& request, std::uint64_t id = 5) { RequestAs(client_, request, id); }

  void RequestAs(const Address& client, const proto::ControlRequest& request, std::uint64_t id) {
    proto::Message message = MessageOf(request);
    message.set_request_id(id);
    ASSERT_EQ(team_.Post(client, gateway_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  // Returns the message that the gateway sent to `actor` since the last call. The test fails unless there is exactly
  // one.
  proto::Message Asked(const std::string& actor) {
    const auto messages = team_.TakeMessages({1, actor});
    EXPECT_EQ(messages.size(), 1u) << actor;
    return messages.empty() ? proto::Message() : messages.front();
  }

  static proto::ControlReply ReplyIn(const proto::Message& message) {
    const auto reply = ControlReplyOf(message);
    EXPECT_TRUE(reply);
    return reply ? *reply : proto::ControlReply();
  }

  static proto::ControlRequest RequestIn(const proto::Message& message) {
    const auto request = ControlRequestOf(message);
    EXPECT_TRUE(request);
    return request ? *request : proto::ControlRequest();
  }

  void AnswerAs(const std::string& actor, const proto::Message& asked, proto::Message answer) {
    answer.set_request_id(asked.request_id());
    (void)team_.Post({1, actor}, gateway_, answer);
    team_.RunUntilIdle();
  }

  std::vector<proto::Message> Answers() { return team_.TakeMessages(client_); }

  proto::ControlReply OnlyAnswer(std::uint64_t id = 5) {
    const auto answers = Answers();
    EXPECT_EQ(answers.size(), 1u);
    if (answers.empty()) return {};
    EXPECT_EQ(answers.front().request_id(), id);
    return ReplyIn(answers.front());
  }

  const Address client_{1, "client"};
  const Address gateway_{1, actor_name::kGateway};
  proto::TeamConfig team_config_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

proto::ControlRequest Optimize() {
  proto::ControlRequest request;
  request.mutable_optimize();
  return request;
}

// Returns a request that agent 1 must relay to agent 2: a read of agent 2's records.
proto::ControlRequest ReadAtTwo() {
  proto::ControlRequest request;
  request.mutable_read();
  request.set_for_agent(2);
  return request;
}

TEST_F(GatewayActorTest, ForwardsAnInsertAndReturnsTheReplyWithTheClientsRequestId) {
  proto::ControlRequest request;
  request.mutable_insert()->add_records()->mutable_temperature()->set_celsius(3);
  Request(request, 42);
  const proto::Message asked = Asked(actor_name::kStorage);
  EXPECT_EQ(asked.insert_request().records(0).temperature().celsius(), 3);
  EXPECT_TRUE(Answers().empty());

  proto::Message answer;
  answer.mutable_insert_reply()->add_keys()->set_seq(9);
  AnswerAs(actor_name::kStorage, asked, answer);
  EXPECT_EQ(OnlyAnswer(42).insert().keys(0).seq(), 9u);
}

TEST_F(GatewayActorTest, CopiesTheErrorOfAReplyToTheTopLevel) {
  Request(Optimize());
  proto::Message answer;
  answer.mutable_optimize_reply()->mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  AnswerAs(actor_name::kPgo, Asked(actor_name::kPgo), answer);
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(GatewayActorTest, ForwardsTheOptionsOfASolve) {
  proto::ControlRequest request = Optimize();
  request.mutable_optimize()->set_window_nodes(7);
  Request(request);
  EXPECT_EQ(Asked(actor_name::kPgo).optimize_request().window_nodes(), 7u);
}

TEST_F(GatewayActorTest, ForwardsACustomQuestionToTheUsersActorAndReturnsItsAnswer) {
  proto::ControlRequest request;
  request.mutable_custom()->set_actor("soil");
  request.mutable_custom()->mutable_body()->set_value("question");
  Request(request, 42);
  const proto::Message asked = Asked("soil");
  EXPECT_EQ(asked.custom().value(), "question");

  proto::Message answer;
  answer.mutable_custom()->set_value("answer");
  AnswerAs("soil", asked, answer);
  EXPECT_EQ(OnlyAnswer(42).custom().value(), "answer");
}

TEST_F(GatewayActorTest, RefusesACustomQuestionToAStandardActor) {
  for (const char* actor : {actor_name::kStorage, actor_name::kGateway, "nobody", ""}) {
    proto::ControlRequest request;
    request.mutable_custom()->set_actor(actor);
    request.mutable_custom()->mutable_body();
    Request(request);
    EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_NOT_FOUND) << actor;
    EXPECT_TRUE(team_.TakeMessages({1, actor}).empty()) << actor;
  }
}

TEST_F(GatewayActorTest, CombinesTheStatusOfStorageRolesLeasesAndTheSystem) {
  proto::ControlRequest request;
  request.mutable_status();
  Request(request);
  proto::ControlReply roles;
  roles.mutable_status()->mutable_roles()->set_leader(1);
  AnswerAs(actor_name::kRole, Asked(actor_name::kRole), MessageOf(roles));
  EXPECT_TRUE(Answers().empty());
  proto::ControlReply storage;
  storage.mutable_status()->mutable_storage()->set_database_bytes(4096);
  AnswerAs(actor_name::kStorage, Asked(actor_name::kStorage), MessageOf(storage));
  EXPECT_TRUE(Answers().empty());
  proto::ControlReply leases;
  leases.mutable_status()->add_leases()->set_agent_id(2);
  AnswerAs(actor_name::kLease, Asked(actor_name::kLease), MessageOf(leases));
  EXPECT_TRUE(Answers().empty());
  proto::ControlReply findings;
  findings.mutable_status()->add_findings()->set_text("rover2 disconnected before it answered");
  AnswerAs(actor_name::kEvent, Asked(actor_name::kEvent), MessageOf(findings));

  const proto::AgentStatus status = OnlyAnswer().status();
  ASSERT_EQ(status.findings_size(), 1);
  EXPECT_EQ(status.findings(0).text(), "rover2 disconnected before it answered");
  EXPECT_EQ(status.name(), "rover1");
  EXPECT_EQ(status.team(), "test");
  EXPECT_EQ(status.role(), proto::ROLE_LEADER);
  EXPECT_EQ(status.roles().leader(), 1u);
  ASSERT_EQ(status.leases_size(), 1);
  EXPECT_EQ(status.leases(0).agent_id(), 2u);
  EXPECT_EQ(status.storage().database_bytes(), 4096);
  EXPECT_EQ(status.merge_backend(), "cpu");
  EXPECT_EQ(status.version(), "1.2.3");
  EXPECT_EQ(status.pid(), 77u);
}

TEST_F(GatewayActorTest, ForwardsAnAcknowledgmentAndLogsItsClient) {
  proto::ControlRequest request;
  request.mutable_acknowledge()->set_until_ns(77);
  request.set_by("anna@hill");
  Request(request);
  const proto::Message written = Asked(actor_name::kStorage);
  EXPECT_EQ(written.insert_request().records(0).agent_event().text(), "health acknowledge");
  EXPECT_EQ(written.insert_request().records(0).agent_event().by(), "anna@hill");
  const proto::Message asked = Asked(actor_name::kEvent);
  EXPECT_EQ(RequestIn(asked).acknowledge().until_ns(), 77);
  proto::ControlReply answer;
  answer.mutable_acknowledge()->set_count(2);
  AnswerAs(actor_name::kEvent, asked, MessageOf(answer));
  EXPECT_EQ(OnlyAnswer().acknowledge().count(), 2u);
}

TEST_F(GatewayActorTest, MergesTheShareStatusOfSyncAndReplication) {
  proto::ControlRequest request;
  request.mutable_share_status();
  Request(request);
  proto::ControlReply part;
  part.mutable_share_status()->add_sessions()->set_destination(2);
  part.mutable_share_status()->set_received_records(3);
  part.mutable_share_status()->mutable_roles()->mutable_term()->set_number(5);
  AnswerAs(actor_name::kSync, Asked(actor_name::kSync), MessageOf(part));
  part.mutable_share_status()->mutable_roles()->mutable_term()->set_number(4);
  part.mutable_share_status()->add_gathers_from(3);
  AnswerAs(actor_name::kReplica, Asked(actor_name::kReplica), MessageOf(part));
  const proto::ShareStatus status = OnlyAnswer().share_status();
  EXPECT_EQ(status.sessions_size(), 2);
  EXPECT_EQ(status.received_records(), 6);
  EXPECT_EQ(status.roles().term().number(), 4u) << "that both have heard of";
  EXPECT_EQ(status.gathers_from_size(), 1);
}

TEST_F(GatewayActorTest, ForwardsHaveAndVerifyRequestsToStorage) {
  proto::ControlRequest request;
  request.mutable_have();
  Request(request);
  proto::Message answer;
  answer.mutable_have_reply()->set_epoch(7);
  const proto::Message have = Asked(actor_name::kStorage);
  EXPECT_TRUE(have.has_have_request());
  AnswerAs(actor_name::kStorage, have, answer);
  EXPECT_EQ(OnlyAnswer().have().epoch(), 7u);

  request.mutable_verify()->set_after_row_id(9);
  Request(request);
  answer.mutable_verify_reply()->set_checked_count(3);
  const proto::Message verify = Asked(actor_name::kStorage);
  EXPECT_EQ(verify.verify_request().after_row_id(), 9u);
  AnswerAs(actor_name::kStorage, verify, answer);
  EXPECT_EQ(OnlyAnswer().verify().checked_count(), 3);

  request.mutable_fingerprint()->mutable_stream()->set_epoch(8);
  Request(request);
  answer.mutable_fingerprint_reply()->mutable_error()->set_code(proto::ERROR_CODE_INVALID);
  const proto::Message fingerprint = Asked(actor_name::kStorage);
  EXPECT_EQ(fingerprint.fingerprint_request().stream().epoch(), 8u);
  AnswerAs(actor_name::kStorage, fingerprint, answer);
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(GatewayActorTest, WaitsLongerForTheCheckOfAFile) {
  proto::ControlRequest request;
  request.mutable_verify()->set_part(proto::VERIFY_PART_ROWS);
  Request(request, 5);
  request.mutable_verify()->set_part(proto::VERIFY_PART_FILE);
  Request(request, 6);
  team_.AdvanceTime(seconds(61));
  EXPECT_EQ(OnlyAnswer(5).error().code(), proto::ERROR_CODE_TIMED_OUT);
  team_.AdvanceTime(seconds(540));
  EXPECT_EQ(OnlyAnswer(6).error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(GatewayActorTest, SendsAShareToTheActorOfItsKind) {
  proto::ControlRequest request;
  request.mutable_share()->set_kind(proto::SHARING_KIND_REPLICATION);
  Request(request);
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kSync}).empty());
  EXPECT_TRUE(Asked(actor_name::kReplica).has_share_request());
}

TEST_F(GatewayActorTest, ForwardsALeaseAndReturnsItsError) {
  proto::ControlRequest request;
  request.mutable_lease()->set_kind(proto::LEASE_KIND_DRIVING);
  request.mutable_lease()->set_seconds(-5);
  Request(request);
  const proto::Message asked = Asked(actor_name::kLease);
  EXPECT_EQ(asked.lease_request().kind(), proto::LEASE_KIND_DRIVING);
  EXPECT_EQ(asked.lease_request().seconds(), -5);
  proto::Message answer;
  answer.mutable_lease_reply()->mutable_error()->set_code(proto::ERROR_CODE_INVALID);
  AnswerAs(actor_name::kLease, asked, answer);
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(GatewayActorTest, ForwardsAPruneAndReturnsItsAnswer) {
  proto::ControlRequest request;
  request.mutable_prune()->set_older_than_s(5);
  Request(request);
  const proto::Message asked = Asked(actor_name::kRetention);
  EXPECT_EQ(asked.prune_order().older_than_s(), 5);
  proto::Message answer;
  answer.mutable_prune_reply()->set_text("rover2 cannot be reached");
  AnswerAs(actor_name::kRetention, asked, answer);
  EXPECT_EQ(OnlyAnswer().prune().text(), "rover2 cannot be reached");
}

TEST_F(GatewayActorTest, AnswersAMessageWithoutARequestAtOnce) {
  Request({});
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(GatewayActorTest, AnswersARequestThatDoesNotDecodeAtOnce) {
  proto::ControlRequest many;  // Each record takes two bytes on the wire and far more in memory.
  for (int i = 0; i < 300'000; ++i) many.mutable_insert()->add_records();
  for (const std::string& bytes : {std::string("\xff\xff"), many.SerializeAsString()}) {
    proto::Message message;
    message.set_request_id(5);
    message.set_control_request(bytes);
    ASSERT_EQ(team_.Post(client_, gateway_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_CORRUPT);
  }
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kStorage}).empty());
}

TEST_F(GatewayActorTest, ReportsThatAnotherAgentsAnswerDoesNotDecode) {
  Request(ReadAtTwo());  // Agent 2 runs no gateway. The test answers in its place.
  team_.AdvanceTime(seconds(1));
  const auto asked = team_.TakeMessages({2, actor_name::kGateway});
  ASSERT_EQ(asked.size(), 1u);
  proto::Message answer;
  answer.set_request_id(asked[0].request_id());
  answer.set_control_reply("\xff\xff");
  (void)team_.Post({2, actor_name::kGateway}, gateway_, answer);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_CORRUPT);
}

TEST_F(GatewayActorTest, AnswersInTimeForAnActorThatDoesNot) {
  proto::ControlRequest request;
  request.mutable_status();
  Request(request);
  Request(Optimize(), 6);
  team_.AdvanceTime(seconds(59));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(2));
  const proto::ControlReply status = OnlyAnswer();
  EXPECT_EQ(status.error().code(), proto::ERROR_CODE_TIMED_OUT);
  EXPECT_EQ(status.error().text(), "event and lease and role and storage did not answer in time");
  // The gateway waits ten minutes for the answer to an optimize request.
  team_.AdvanceTime(seconds(535));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(OnlyAnswer(6).error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(GatewayActorTest, BoundsTheNumberOfPendingRequests) {
  for (std::uint64_t id = 1; id <= 4; ++id) Request(Optimize(), id);
  EXPECT_TRUE(Answers().empty());
  Request(Optimize(), 5);
  EXPECT_EQ(OnlyAnswer(5).error().code(), proto::ERROR_CODE_FULL);
  const auto asked = team_.TakeMessages({1, actor_name::kPgo});
  ASSERT_EQ(asked.size(), 4u);
  proto::Message answer;
  answer.mutable_optimize_reply();
  AnswerAs(actor_name::kPgo, asked[0], answer);
  EXPECT_TRUE(OnlyAnswer(1).has_optimize());
  Request(Optimize(), 6);
  EXPECT_TRUE(Answers().empty());
}

TEST_F(GatewayActorTest, IgnoresAnswersThatMatchNoRequest) {
  Request(Optimize());
  const proto::Message asked = Asked(actor_name::kPgo);
  proto::Message answer;
  answer.mutable_optimize_reply();
  AnswerAs(actor_name::kMerge, asked, answer);  // This answer comes from an actor that was not asked.
  proto::Message other = asked;
  other.set_request_id(asked.request_id() + 1);
  AnswerAs(actor_name::kPgo, other, answer);  // This answer has the id of another request.
  answer.set_request_id(asked.request_id());
  (void)team_.Post({2, actor_name::kPgo}, gateway_, answer);  // This answer comes from another agent.
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(Answers().empty());
  AnswerAs(actor_name::kPgo, asked, answer);
  EXPECT_TRUE(OnlyAnswer().has_optimize());
  AnswerAs(actor_name::kPgo, asked, answer);  // The gateway ignores a repeated answer.
  EXPECT_TRUE(Answers().empty());
}

TEST_F(GatewayActorTest, RefusesTheRequestOfAnotherAgent) {
  const Address other{2, "client"};
  RequestAs(other, Optimize(), 5);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kPgo}).empty());
  const auto answers = team_.TakeMessages(other);
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(ReplyIn(answers[0]).error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(GatewayActorTest, LogsSomeOfManyCommandsOfAKindAndTheNumberOfTheRest) {
  proto::ControlRequest share;
  share.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  share.set_by("robot");
  const auto texts = [this] {
    std::vector<std::string> events;
    for (const proto::Message& asked : team_.TakeMessages({1, actor_name::kStorage})) {
      events.push_back(asked.insert_request().records(0).agent_event().text());
    }
    return events;
  };
  for (std::uint64_t id = 0; id < 100; ++id) {
    Request(share, id);
    const auto asked = team_.TakeMessages({1, actor_name::kSync});
    proto::Message done;
    done.mutable_share_reply();
    for (const proto::Message& order : asked) AnswerAs(actor_name::kSync, order, done);
  }
  EXPECT_EQ(Answers().size(), 100u) << "each is done";
  EXPECT_EQ(texts(), std::vector<std::string>(20, "sync now"));
  Request(Optimize());
  EXPECT_EQ(texts(), std::vector<std::string>{"graph optimize"}) << "of another kind";
  team_.AdvanceTime(seconds(61));
  EXPECT_EQ(texts(), std::vector<std::string>{"sync now: the last of 80 more commands"});
  Request(share);
  EXPECT_EQ(texts(), std::vector<std::string>{"sync now"}) << "in the next minute";
  team_.AdvanceTime(seconds(61));
  EXPECT_TRUE(texts().empty());
}

proto::ControlRequest SyncAndWait(double wait_s) {
  proto::ControlRequest request;
  request.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  request.mutable_share()->set_wait_s(wait_s);
  return request;
}

TEST_F(GatewayActorTest, WaitsForTheEndOfAnOrderAsLongAsRequested) {
  Request(SyncAndWait(3600));
  const proto::Message asked = Asked(actor_name::kSync);
  EXPECT_EQ(asked.share_request().wait_s(), 3600);
  team_.AdvanceTime(seconds(3599));
  EXPECT_TRUE(Answers().empty());
  proto::Message done;
  done.mutable_share_reply()->mutable_progress()->set_is_complete(true);
  AnswerAs(actor_name::kSync, asked, done);
  EXPECT_TRUE(OnlyAnswer().share().progress().is_complete());
}

TEST_F(GatewayActorTest, AnswersARelayedWaitingRequestWithOneMessage) {
  std::map<std::pair<AgentId, AgentId>, int> messages;
  team_.SetFilter([&](AgentId from, AgentId to, const proto::Message&) { return ++messages[{from, to}] > 0; });
  proto::ControlRequest request = SyncAndWait(3600);
  request.set_for_agent(1);
  RequestAs({2, actor_name::kGateway}, request, 6);
  team_.AdvanceTime(seconds(1));
  const proto::Message asked = Asked(actor_name::kSync);
  team_.AdvanceTime(seconds(3598));
  EXPECT_EQ((messages[{1, 2}]), 0) << "the wait itself sends nothing";
  EXPECT_EQ((messages[{2, 1}]), 1) << "the request";
  proto::Message done;
  done.mutable_share_reply()->mutable_progress()->set_is_complete(true);
  AnswerAs(actor_name::kSync, asked, done);
  team_.AdvanceTime(seconds(3600));
  EXPECT_EQ((messages[{1, 2}]), 1) << "the answer";
  EXPECT_EQ((messages[{2, 1}]), 1);
  const auto answers = team_.TakeMessages({2, actor_name::kGateway});
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_TRUE(ReplyIn(answers.front()).share().progress().is_complete());
}

TEST_F(GatewayActorTest, FailsAWaitingRequestIfTheActorRestarts) {
  class SilentActor final : public Actor {
    void OnMessage(Context&, const proto::Message&) override {}
  };
  team_.Spawn(1, actor_name::kSync, [] { return std::make_unique<SilentActor>(); });
  team_.RunUntilIdle();
  Request(SyncAndWait(3600));
  EXPECT_TRUE(Answers().empty());
  team_.CrashActor({1, actor_name::kSync});
  team_.RunUntilIdle();
  const proto::ControlReply reply = OnlyAnswer();
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_UNAVAILABLE);
  EXPECT_EQ(reply.error().text(), "sync restarted before it answered; ask again");
}

TEST_F(GatewayActorTest, RequestsNewsFromTheActorOfTheOrdersKind) {
  for (const auto& [kind, actor] : {std::pair(proto::SHARING_KIND_SYNC, actor_name::kSync),
                                    std::pair(proto::SHARING_KIND_REPLICATION, actor_name::kReplica)}) {
    proto::ControlRequest request;
    request.mutable_share_progress()->set_kind(kind);
    request.mutable_share_progress()->set_order(5);
    request.mutable_share_progress()->set_is_relayed(true);
    Request(request);
    const proto::Message asked = Asked(actor);
    EXPECT_EQ(asked.share_progress_request().order(), 5u);
    EXPECT_FALSE(asked.share_progress_request().is_relayed()) << "a client of this agent's own does not say so";
    proto::Message news;
    news.mutable_share_progress()->set_version(3);
    AnswerAs(actor, asked, news);
    EXPECT_EQ(OnlyAnswer().share_progress().version(), 3u);
  }
}

// Tests reads with wait_s, which wait until a record is stored.
class FeedTest : public GatewayActorTest {
 protected:
  static proto::ControlRequest Feed(double wait_s, DataType type = 0) {
    proto::ControlRequest request;
    request.mutable_read()->set_wait_s(wait_s);
    request.mutable_read()->set_after_row_id(7);
    if (type != 0) request.mutable_read()->add_data_types(type);
    return request;
  }
  // Sends storage's answer to the request `asked`: a complete page with `records` records.
  void AnswerPage(const proto::Message& asked, int records) {
    proto::Message page;
    page.mutable_read_reply()->set_is_complete(true);
    for (int i = 0; i < records; ++i) {
      page.mutable_read_reply()->add_records();
      page.mutable_read_reply()->add_row_ids(8 + i);
    }
    AnswerAs(actor_name::kStorage, asked, page);
  }
  void ReportStored(DataType type, const std::string& actor = actor_name::kStorage, std::uint64_t last_row_id = 8) {
    proto::Message stored;
    stored.mutable_records_stored()->set_last_row_id(last_row_id);
    stored.mutable_records_stored()->add_data_types(type);
    (void)team_.Post({1, actor}, gateway_, stored);
    team_.RunUntilIdle();
  }
  std::size_t AskedOfStorage() { return team_.TakeMessages({1, actor_name::kStorage}).size(); }
};

TEST_F(FeedTest, AnswersAtOnceIfRecordsAreStored) {
  Request(Feed(30));
  const proto::Message asked = Asked(actor_name::kStorage);
  EXPECT_EQ(asked.read_request().after_row_id(), 7u);
  EXPECT_EQ(asked.read_request().records_max(), kReadRecordsDefault);
  AnswerPage(asked, 2);
  EXPECT_EQ(OnlyAnswer().read().row_ids_size(), 2);
}

TEST_F(FeedTest, WaitsUntilARecordOfItsTypesIsStored) {
  Request(Feed(30, proto::TEMPERATURE));
  AnswerPage(Asked(actor_name::kStorage), 0);
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(10));
  ReportStored(proto::POWER);
  ReportStored(proto::TEMPERATURE, "soil");  // The gateway ignores a report that does not come from storage.
  EXPECT_EQ(AskedOfStorage(), 0u);
  ReportStored(proto::TEMPERATURE);
  const proto::Message again = Asked(actor_name::kStorage);
  // Storage's pending answer may lack this record, so the gateway reads again after that answer.
  ReportStored(proto::TEMPERATURE);
  EXPECT_EQ(AskedOfStorage(), 0u);
  AnswerPage(again, 0);
  AnswerPage(Asked(actor_name::kStorage), 1);
  EXPECT_EQ(OnlyAnswer().read().row_ids(0), 8u);
  ReportStored(proto::TEMPERATURE);
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(AskedOfStorage(), 0u);
  EXPECT_TRUE(Answers().empty());
}

TEST_F(FeedTest, ReadsAgainOnlyAfterTheRowsOfTheLastEmptyAnswer) {
  Request(Feed(30));
  AnswerPage(Asked(actor_name::kStorage), 0);
  ReportStored(proto::POWER, actor_name::kStorage, 20);
  const proto::Message first = Asked(actor_name::kStorage);
  EXPECT_EQ(first.read_request().after_row_id(), 7u);
  ReportStored(proto::POWER, actor_name::kStorage, 25);  // Storage's pending answer may lack rows 21 to 25.
  AnswerPage(first, 0);
  const proto::Message second = Asked(actor_name::kStorage);
  EXPECT_EQ(second.read_request().after_row_id(), 20u);
  AnswerPage(second, 0);
  ReportStored(proto::POWER, actor_name::kStorage, 30);
  EXPECT_EQ(Asked(actor_name::kStorage).read_request().after_row_id(), 25u);
}

TEST_F(FeedTest, ReturnsAnEmptyPageWhenTheTimeIsUp) {
  Request(Feed(30));
  AnswerPage(Asked(actor_name::kStorage), 0);
  team_.AdvanceTime(seconds(29));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(2));
  const proto::ControlReply reply = OnlyAnswer();
  EXPECT_TRUE(reply.has_read());
  EXPECT_FALSE(reply.has_error());
  EXPECT_EQ(reply.read().records_size(), 0);
}

TEST_F(FeedTest, WaitsForStoragesAnswerBeyondTheEndOfItsWait) {
  Request(Feed(5));
  const proto::Message asked = Asked(actor_name::kStorage);
  team_.AdvanceTime(seconds(10));
  EXPECT_TRUE(Answers().empty());
  AnswerPage(asked, 0);
  EXPECT_TRUE(OnlyAnswer().has_read());
  Request(Feed(5));
  team_.AdvanceTime(seconds(66));
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(FeedTest, LimitsTheNumberOfWaitingReads) {
  for (std::uint64_t id = 1; id <= 2; ++id) Request(Feed(30), id);
  for (const proto::Message& asked : team_.TakeMessages({1, actor_name::kStorage})) AnswerPage(asked, 0);
  Request(Feed(30), 3);
  EXPECT_EQ(OnlyAnswer(3).error().code(), proto::ERROR_CODE_FULL);
  proto::ControlRequest read;
  read.mutable_read();
  Request(read, 4);
  AnswerPage(Asked(actor_name::kStorage), 0);
  EXPECT_TRUE(OnlyAnswer(4).has_read()) << "a read that does not wait is none";
  team_.AdvanceTime(seconds(31));
  EXPECT_EQ(Answers().size(), 2u);
  Request(Feed(30), 5);
  EXPECT_EQ(AskedOfStorage(), 1u);
}

TEST_F(FeedTest, LimitsThePendingRequestsOfEachClient) {
  GatewayActor::Options options;
  options.self = 2;
  options.team = team_config_;
  options.pending_of_client_max = 2;
  options.waits_of_client_max = 1;
  options.relays_of_client_max = 1;
  const Address gateway{2, actor_name::kGateway};
  team_.Spawn(2, actor_name::kGateway, [options] { return std::make_unique<GatewayActor>(options); });
  const auto ask = [&](const std::string& connection, const std::string& key_name, const proto::ControlRequest& asked) {
    proto::Message message = MessageOf(asked);
    message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
    message.set_client_name(key_name);
    (void)team_.Post({kClients, connection}, gateway, message);
    team_.RunUntilIdle();
    const auto answers = team_.TakeMessages({kClients, connection});
    return answers.empty() ? "" : ReplyIn(answers.front()).error().text();
  };
  EXPECT_EQ(ask("k1", "anna", Feed(30)), "");
  EXPECT_THAT(ask("k2", "anna", Feed(30)), testing::HasSubstr("too many requests of this client with a wait time"));
  EXPECT_EQ(ask("k2", "anna", Optimize()), "");
  EXPECT_THAT(ask("k3", "anna", Optimize()), testing::HasSubstr("too many requests of this client"));
  EXPECT_EQ(ask("k4", "bob", Feed(30)), "");
  EXPECT_EQ(ask("1", "", Feed(30)), "");
  EXPECT_NE(ask("1", "", Feed(30)), "");
  EXPECT_EQ(ask("2", "", Feed(30)), "");

  proto::ControlRequest relayed;
  relayed.mutable_status();
  relayed.set_for_agent(1);
  EXPECT_EQ(ask("k5", "carol", relayed), "");
  EXPECT_THAT(ask("k6", "carol", relayed),
              testing::HasSubstr("too many requests of this client wait for an answer of"));
  EXPECT_EQ(ask("k7", "dave", relayed), "");

  // All requests from one other agent count as requests of the same client, even if different actors send them.
  const auto ask_as = [&](const Address& requester) {
    proto::ControlRequest asked = Feed(30);
    asked.set_for_agent(2);
    (void)team_.Post(requester, gateway, MessageOf(asked));
    team_.AdvanceTime(seconds(1));
    const auto answers = team_.TakeMessages(requester);
    return answers.empty() ? "" : ReplyIn(answers.front()).error().text();
  };
  EXPECT_EQ(ask_as({1, "asker1"}), "");
  EXPECT_THAT(ask_as({1, "asker2"}), testing::HasSubstr("of this client"));
}

// A client with a key that is listed under the name anna.
class KeyedClientTest : public GatewayActorTest {
 protected:
  proto::ControlReply RequestWith(proto::ClientRights rights, const proto::ControlRequest& request) {
    proto::Message message = MessageOf(request);
    message.set_request_id(5);
    message.set_client_rights(rights);
    message.set_client_name("anna");
    (void)team_.Post(keyed_, gateway_, message);
    team_.RunUntilIdle();
    const auto answers = team_.TakeMessages(keyed_);
    return answers.empty() ? proto::ControlReply() : ReplyIn(answers.front());
  }
  static proto::ControlRequest SetLeader() {
    proto::ControlRequest request;
    request.mutable_role_set()->set_leader(2);
    request.set_by("somebody else");
    return request;
  }
  double RefusedClients() {
    proto::ControlRequest request;
    request.mutable_status();
    Request(request, 77);
    proto::ControlReply part;
    part.mutable_status();
    for (const char* actor : {actor_name::kStorage, actor_name::kRole, actor_name::kLease, actor_name::kEvent}) {
      AnswerAs(actor, Asked(actor), MessageOf(part));
    }
    return OnlyAnswer(77).status().refused_clients();
  }

  const Address keyed_{kClients, "k1"};
};

TEST_F(KeyedClientTest, IsRefusedRequestsThatItsKeyDoesNotAllow) {
  for (const auto rights : {proto::CLIENT_RIGHTS_NONE, proto::CLIENT_RIGHTS_VIEW, proto::CLIENT_RIGHTS_SHARE}) {
    EXPECT_EQ(RequestWith(rights, SetLeader()).error().code(), proto::ERROR_CODE_REFUSED) << rights;
  }
  proto::ControlRequest relayed = SetLeader();
  relayed.set_for_agent(2);
  EXPECT_EQ(RequestWith(proto::CLIENT_RIGHTS_SHARE, relayed).error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(RequestWith(proto::CLIENT_RIGHTS_VIEW, Optimize()).error().code(), proto::ERROR_CODE_REFUSED);
  team_.AdvanceTime(seconds(1));
  for (const char* actor : {actor_name::kRole, actor_name::kStorage, actor_name::kPgo}) {
    EXPECT_TRUE(team_.TakeMessages({1, actor}).empty()) << actor;
  }
  EXPECT_TRUE(team_.TakeMessages({2, actor_name::kGateway}).empty());
  EXPECT_EQ(RefusedClients(), 5);
}

TEST_F(KeyedClientTest, IsLoggedUnderItsKeysName) {
  EXPECT_FALSE(IsError(RequestWith(proto::CLIENT_RIGHTS_COMMAND, SetLeader()).error()));
  const proto::Record record = Asked(actor_name::kStorage).insert_request().records(0);
  EXPECT_EQ(record.agent_event().by(), "anna (key)");
  EXPECT_TRUE(Asked(actor_name::kRole).has_role_set_request());
  proto::ControlRequest relayed = SetLeader();
  relayed.set_for_agent(2);
  RequestWith(proto::CLIENT_RIGHTS_COMMAND, relayed);
  team_.AdvanceTime(seconds(1));
  const auto at_other = team_.TakeMessages({2, actor_name::kGateway});
  ASSERT_EQ(at_other.size(), 1u);
  EXPECT_EQ(RequestIn(at_other.front()).by(), "anna (key)");
}

TEST_F(KeyedClientTest, CannotBeImpersonatedByAClientWithoutAKey) {
  proto::ControlRequest request = SetLeader();
  for (const auto& [said, written] : std::map<std::string, std::string>{
           {"anna (key)", "anna"}, {"anna(key) (key) ", "anna"}, {"anna@hill", "anna@hill"}}) {
    request.set_by(said);
    proto::Message message = MessageOf(request);
    message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);  // A client over ipc has all rights.
    (void)team_.Post({kClients, "c1"}, gateway_, message);
    team_.RunUntilIdle();
    EXPECT_EQ(Asked(actor_name::kStorage).insert_request().records(0).agent_event().by(), written);
  }
}

TEST_F(GatewayActorTest, LogsACommandAndItsClientBeforeCarryingItOut) {
  proto::ControlRequest request;
  request.mutable_role_set()->set_leader(2);
  request.mutable_role_set()->set_reason("sun is low");
  request.set_by("anna@hill");
  Request(request);
  const proto::Record record = Asked(actor_name::kStorage).insert_request().records(0);
  EXPECT_EQ(record.agent_event().kind(), proto::EVENT_KIND_COMMAND);
  EXPECT_EQ(record.agent_event().text(), "role set: leader rover2 (sun is low)");
  EXPECT_EQ(record.agent_event().by(), "anna@hill");
  EXPECT_TRUE(CheckRecord(record).has_value());

  request.mutable_role_set()->set_reason(std::string(255, 'x') + "\n");
  request.set_by(std::string(5000, 'y'));
  request.set_for_agent(1);
  RequestAs({2, actor_name::kGateway}, request, 6);
  team_.AdvanceTime(seconds(1));
  const proto::Record relayed = Asked(actor_name::kStorage).insert_request().records(0);
  EXPECT_THAT(relayed.agent_event().text(), testing::EndsWith(", through rover2"));
  EXPECT_TRUE(CheckRecord(relayed).has_value());

  request.mutable_status();  // A status request changes nothing, so it is not logged.
  request.clear_for_agent();
  Request(request);
  for (const proto::Message& asked : team_.TakeMessages({1, actor_name::kStorage}))
    EXPECT_FALSE(asked.has_insert_request());
}

// A team of rovers 1 and 2 and base station 3. Agent 1 accepts another agent's commands only from the base station.
class CommandFromTest : public GatewayActorTest {
 protected:
  CommandFromTest() : GatewayActorTest(/*has_base=*/true) {}

  // Sends `request` to agent 1 in the name of agent `from`'s gateway. Returns the answer, or an empty reply if there is
  // none.
  proto::ControlReply Relay(AgentId from, const proto::ControlRequest& request) {
    RequestAs({from, actor_name::kGateway}, request, 6);
    team_.AdvanceTime(seconds(1));
    const auto answers = team_.TakeMessages({from, actor_name::kGateway});
    EXPECT_LE(answers.size(), 1u);
    return answers.empty() ? proto::ControlReply() : ReplyIn(answers.front());
  }
  static proto::ControlRequest SetLeader() {
    proto::ControlRequest request;
    request.mutable_role_set()->set_leader(2);
    request.set_for_agent(1);
    request.set_by("anna (key)");
    return request;
  }

  // Requests the status of agent 1 and answers for each of its other actors with an empty status. Returns the gateway's
  // reply.
  proto::ControlReply RequestStatus() {
    proto::ControlRequest status;
    status.mutable_status();
    Request(status, 77);
    proto::ControlReply part;
    part.mutable_status();
    for (const char* actor : {actor_name::kStorage, actor_name::kRole, actor_name::kLease, actor_name::kEvent}) {
      AnswerAs(actor, Asked(actor), MessageOf(part));
    }
    return OnlyAnswer(77);
  }
};

TEST_F(CommandFromTest, IsCheckedBeforeARelayedCommandIsCarriedOut) {
  const proto::ControlReply refused = Relay(2, SetLeader());
  EXPECT_EQ(refused.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(refused.error().field(), "command_from");
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kRole}).empty());
  const proto::Record written = Asked(actor_name::kStorage).insert_request().records(0);
  EXPECT_EQ(written.agent_event().kind(), proto::EVENT_KIND_REJECTED);
  EXPECT_EQ(written.agent_event().text(),
            "refused role_set relayed by rover2: command_from of the team file does not name this agent");

  Relay(3, SetLeader());
  EXPECT_TRUE(Asked(actor_name::kRole).has_role_set_request());
}

TEST_F(CommandFromTest, CountsRefusedCommandsAndLogsAFewPerMinute) {
  for (int i = 0; i < 50; ++i) Relay(2, SetLeader());
  EXPECT_EQ(team_.TakeMessages({1, actor_name::kStorage}).size(), 2u);
  team_.AdvanceTime(std::chrono::minutes(1));
  const proto::Record rest = Asked(actor_name::kStorage).insert_request().records(0);
  EXPECT_THAT(rest.agent_event().text(), testing::HasSubstr("the last of 48 more"));

  const proto::ControlReply reply = RequestStatus();
  ASSERT_EQ(reply.status().refused_size(), 1);
  EXPECT_EQ(reply.status().refused(0).agent_id(), 2u);
  EXPECT_EQ(reply.status().refused(0).cause(), proto::REFUSAL_CAUSE_COMMAND);
  EXPECT_EQ(reply.status().refused(0).count(), 50);
}

TEST_F(CommandFromTest, RestartsTheCountOfRefusedCommandsAfterAnAcknowledgment) {
  Relay(2, SetLeader());
  (void)team_.TakeMessages({1, actor_name::kStorage});
  proto::ControlRequest acknowledge;
  acknowledge.mutable_acknowledge();
  Request(acknowledge, 76);
  (void)team_.TakeMessages({1, actor_name::kStorage});
  proto::ControlReply done;
  done.mutable_acknowledge();
  AnswerAs(actor_name::kEvent, Asked(actor_name::kEvent), MessageOf(done));
  (void)OnlyAnswer(76);

  EXPECT_EQ(RequestStatus().status().refused_size(), 0);
}

TEST_F(GatewayActorTest, LogsARefusedCommand) {
  proto::ControlRequest request;
  request.mutable_role_set()->set_is_swap(true);
  request.set_by("anna@hill");
  Request(request);
  EXPECT_EQ(Asked(actor_name::kStorage).insert_request().records(0).agent_event().text(), "role swap");
  proto::ControlReply refusal;
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_error()->set_text("rover1 may not change roles");
  AnswerAs(actor_name::kRole, Asked(actor_name::kRole), MessageOf(refusal));
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_REFUSED);
  const proto::AgentEvent written = Asked(actor_name::kStorage).insert_request().records(0).agent_event();
  EXPECT_EQ(written.kind(), proto::EVENT_KIND_REJECTED);
  EXPECT_EQ(written.text(), "refused role swap: rover1 may not change roles");
  EXPECT_EQ(written.by(), "anna@hill");
}

TEST_F(CommandFromTest, IgnoresAnotherAgentsClaimThatAKeyWasChecked) {
  Relay(3, SetLeader());
  EXPECT_EQ(Asked(actor_name::kStorage).insert_request().records(0).agent_event().by(), "anna");
}

TEST_F(CommandFromTest, AllowsTheLeaderToOrderSharing) {
  proto::ControlRequest share;
  share.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  share.set_for_agent(1);
  EXPECT_EQ(Relay(2, share).error().code(), proto::ERROR_CODE_REFUSED);
  proto::Message changed;
  changed.mutable_roles_changed()->mutable_roles()->set_leader(2);
  ASSERT_EQ(team_.Post({1, actor_name::kRole}, gateway_, changed), SendResult::kAccepted);
  Relay(2, share);
  EXPECT_TRUE(Asked(actor_name::kSync).has_share_request());
}

TEST_F(GatewayActorTest, RelaysARequestToAnotherAgentAndReturnsItsAnswer) {
  SpawnGateway(2);
  Request(ReadAtTwo(), 42);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kStorage}).empty());
  const auto asked = team_.TakeMessages({2, actor_name::kStorage});
  ASSERT_EQ(asked.size(), 1u);
  // The limit for agent 2's own clients is 1 MB.
  EXPECT_EQ(asked[0].read_request().content_bytes_max(), kRelayedContentBytesMax);
  proto::Message page;
  page.set_request_id(asked[0].request_id());
  page.mutable_read_reply()->set_is_complete(true);
  ASSERT_EQ(team_.Post({2, actor_name::kStorage}, {2, actor_name::kGateway}, page), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(OnlyAnswer(42).read().is_complete());
}

TEST_F(GatewayActorTest, WaitsForARelayedReadALittleLongerThanTheReadItself) {
  proto::ControlRequest request = ReadAtTwo();
  request.mutable_read()->set_wait_s(30);
  Request(request);
  team_.AdvanceTime(seconds(89));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(GatewayActorTest, RefusesAnAnswerTooLongForTheRadio) {
  SpawnGateway(2);
  for (const std::size_t bytes : {10'000u, 30'000u}) {
    Request(ReadAtTwo());
    team_.AdvanceTime(seconds(1));
    const auto asked = team_.TakeMessages({2, actor_name::kStorage});
    ASSERT_EQ(asked.size(), 1u);
    proto::Message page;
    page.set_request_id(asked[0].request_id());
    page.mutable_read_reply()->add_records()->set_content(std::string(bytes, 'x'));
    ASSERT_EQ(team_.Post({2, actor_name::kStorage}, {2, actor_name::kGateway}, page), SendResult::kAccepted);
    team_.AdvanceTime(seconds(1));
    const proto::ControlReply reply = OnlyAnswer();
    EXPECT_EQ(reply.error().code(), bytes > 20'000 ? proto::ERROR_CODE_FULL : proto::ERROR_CODE_NONE);
  }
}

TEST_F(GatewayActorTest, TheLongestAnswerFitsIntoAMessageBetweenAgents) {
  const std::size_t longest = GatewayActor::Options().relay_bytes_max;
  SpawnGateway(2, longest);
  for (const std::size_t bytes : {longest - 100, longest}) {
    Request(ReadAtTwo());
    team_.AdvanceTime(seconds(1));
    const auto asked = team_.TakeMessages({2, actor_name::kStorage});
    ASSERT_EQ(asked.size(), 1u);
    proto::Message page;
    page.set_request_id(asked[0].request_id());
    page.mutable_read_reply()->add_records()->set_content(std::string(bytes, 'x'));
    ASSERT_EQ(team_.Post({2, actor_name::kStorage}, {2, actor_name::kGateway}, page), SendResult::kAccepted);
    team_.AdvanceTime(seconds(1));
    const proto::ControlReply reply = OnlyAnswer();
    EXPECT_EQ(reply.error().code(), bytes < longest ? proto::ERROR_CODE_NONE : proto::ERROR_CODE_FULL);
  }
}

TEST_F(GatewayActorTest, NamesTheAgentThatCannotBeReachedOrWasLost) {
  SpawnGateway(2);
  Request(ReadAtTwo());
  team_.SetLink(1, 2, false);
  team_.AdvanceTime(seconds(1));
  proto::Error error = OnlyAnswer().error();
  EXPECT_EQ(error.code(), proto::ERROR_CODE_UNAVAILABLE);
  EXPECT_THAT(error.text(), testing::HasSubstr("rover2 disconnected before it answered"));
  Request(ReadAtTwo());
  error = OnlyAnswer().error();
  EXPECT_EQ(error.code(), proto::ERROR_CODE_UNAVAILABLE);
  EXPECT_EQ(error.text(), "rover2 cannot be reached from rover1");

  proto::ControlRequest stranger = ReadAtTwo();
  stranger.set_for_agent(9);
  Request(stranger);
  EXPECT_EQ(OnlyAnswer().error().field(), "for_agent");
}

TEST_F(GatewayActorTest, AcceptsAnAnswerOnlyFromTheAgentThatWasAsked) {
  Request(ReadAtTwo());  // Agent 2 runs no gateway. The test answers in its place.
  team_.AdvanceTime(seconds(1));
  const auto asked = team_.TakeMessages({2, actor_name::kGateway});
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(RequestIn(asked[0]).for_agent(), 2u);
  proto::ControlReply reply;
  reply.mutable_read();
  proto::Message answer = MessageOf(reply);
  answer.set_request_id(asked[0].request_id());
  (void)team_.Post({2, actor_name::kStorage}, gateway_, answer);
  (void)team_.Post({1, actor_name::kStorage}, gateway_, answer);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(60));
  EXPECT_EQ(OnlyAnswer().error().text(), "rover2 did not answer in time");
}

TEST_F(GatewayActorTest, DoesNotForwardARelayedRequestToAThirdAgent) {
  const Address other{2, actor_name::kGateway};
  proto::ControlRequest request = ReadAtTwo();
  RequestAs(other, request, 5);
  team_.AdvanceTime(seconds(1));
  const auto answers = team_.TakeMessages(other);
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(ReplyIn(answers[0]).error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(GatewayActorTest, RefusesARequestForAnotherTeam) {
  const std::string other = TeamIdBytes("ff112233445566778899aabbccddeeff");
  SpawnGateway(2);
  for (const AgentId agent : {0u, 1u, 2u}) {
    proto::ControlRequest request;
    request.mutable_insert()->add_records()->mutable_temperature()->set_celsius(3);
    request.set_for_agent(agent);
    request.set_team_id(other);
    Request(request);
    const proto::ControlReply reply = OnlyAnswer();
    EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_REFUSED);
    EXPECT_EQ(
        reply.error().text(),
        "this agent belongs to another team: test with the team id 00112233; the request is for the team id ff112233");
    EXPECT_EQ(reply.team_id(), TeamIdBytes(team_config_.team_id()));
    for (const AgentId asked : {1u, 2u}) EXPECT_TRUE(team_.TakeMessages({asked, actor_name::kStorage}).empty());
  }
  proto::ControlRequest request;
  request.mutable_stop();
  request.set_team_id("abc");
  Request(request);
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(GatewayActorTest, NamesTheAnsweringAgentInEachReply) {
  SpawnGateway(2);
  for (const AgentId agent : {1u, 2u}) {
    proto::ControlRequest request = Optimize();
    request.set_for_agent(agent);
    request.set_team_id(TeamIdBytes(team_config_.team_id()));
    Request(request);
    team_.AdvanceTime(seconds(1));
    const auto asked = team_.TakeMessages({agent, actor_name::kPgo});
    ASSERT_EQ(asked.size(), 1u);
    proto::Message answer;
    answer.mutable_optimize_reply();
    answer.set_request_id(asked.front().request_id());
    (void)team_.Post({agent, actor_name::kPgo}, {agent, actor_name::kGateway}, answer);
    team_.AdvanceTime(seconds(1));
    const proto::ControlReply reply = OnlyAnswer();
    EXPECT_FALSE(reply.has_error());
    EXPECT_EQ(reply.team_id(), TeamIdBytes(team_config_.team_id()));
    EXPECT_EQ(reply.config_hash(), 40 + agent);
  }
}

TEST_F(GatewayActorTest, RelaysOnlyForItsOwnTeam) {
  (void)team_.TakeMessages({2, actor_name::kGateway});
  proto::ControlRequest request = Optimize();  // The client sets no team_id. The gateway must add it.
  request.set_for_agent(2);
  Request(request);
  team_.AdvanceTime(seconds(1));
  const auto relayed = team_.TakeMessages({2, actor_name::kGateway});
  ASSERT_EQ(relayed.size(), 1u);
  EXPECT_EQ(RequestIn(relayed.front()).team_id(), TeamIdBytes(team_config_.team_id()));
}

TEST_F(GatewayActorTest, RepliesToAStopBeforeItStops) {
  proto::ControlRequest request;
  request.mutable_stop();
  Request(request);
  EXPECT_TRUE(OnlyAnswer().has_stop());
}

}  // namespace
}  // namespace moondb
