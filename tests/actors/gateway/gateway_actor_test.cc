#include "actors/gateway/gateway_actor.h"

#include <gtest/gtest.h>

#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;

// The gateway of agent 1; storage, role and the others are probes.
class GatewayActorTest : public testing::Test {
 protected:
  GatewayActorTest() {
    team_config_.set_team("test");
    for (const std::uint32_t id : {1, 2}) {
      proto::AgentConfig& agent = *team_config_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      team_.AddAgent(id);
    }
    GatewayActor::Options options;
    options.self = 1;
    options.team = team_config_;
    options.version = "1.2.3";
    options.pid = 77;
    options.merge_backend = [] { return "cpu"; };
    options.pending_max = 4;
    options.own_actors = {"soil"};
    team_.Spawn(1, actor_name::kGateway, [options] { return std::make_unique<GatewayActor>(options); });
  }

  void Request(const proto::ControlRequest& request, std::uint64_t id = 5) { RequestAs(client_, request, id); }

  void RequestAs(const Address& client, const proto::ControlRequest& request, std::uint64_t id) {
    proto::Message message;
    message.set_request_id(id);
    *message.mutable_control_request() = request;
    ASSERT_EQ(team_.Post(client, gateway_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  // What the gateway asked `actor`: exactly one message.
  proto::Message Asked(const std::string& actor) {
    const auto messages = team_.Take({1, actor});
    EXPECT_EQ(messages.size(), 1u) << actor;
    return messages.empty() ? proto::Message() : messages.front();
  }

  void AnswerAs(const std::string& actor, const proto::Message& asked, proto::Message answer) {
    answer.set_request_id(asked.request_id());
    (void)team_.Post({1, actor}, gateway_, answer);
    team_.RunUntilIdle();
  }

  std::vector<proto::Message> Answers() { return team_.Take(client_); }

  proto::ControlReply OnlyAnswer(std::uint64_t id = 5) {
    const auto answers = Answers();
    EXPECT_EQ(answers.size(), 1u);
    if (answers.empty()) return {};
    EXPECT_EQ(answers.front().request_id(), id);
    return answers.front().control_reply();
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

TEST_F(GatewayActorTest, PassesAnInsertOnAndItsReplyBackUnderTheClientsRequestId) {
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

TEST_F(GatewayActorTest, LiftsTheErrorOfAReplyToWhereClientsLook) {
  Request(Optimize());
  proto::Message answer;
  answer.mutable_optimize_reply()->mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  AnswerAs(actor_name::kPgo, Asked(actor_name::kPgo), answer);
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(GatewayActorTest, PassesACustomQuestionToTheUsersActorAndItsAnswerBack) {
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

TEST_F(GatewayActorTest, LetsNoCustomQuestionReachAStandardActor) {
  for (const char* actor : {actor_name::kStorage, actor_name::kGateway, "nobody", ""}) {
    proto::ControlRequest request;
    request.mutable_custom()->set_actor(actor);
    request.mutable_custom()->mutable_body();
    Request(request);
    EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_NOT_FOUND) << actor;
    EXPECT_TRUE(team_.Take({1, actor}).empty()) << actor;
  }
}

TEST_F(GatewayActorTest, PutsStatusTogetherFromStorageRolesLeasesAndTheSystem) {
  proto::ControlRequest request;
  request.mutable_status();
  Request(request);
  proto::Message roles;
  roles.mutable_role_show_reply()->mutable_roles()->set_leader(1);
  AnswerAs(actor_name::kRole, Asked(actor_name::kRole), roles);
  EXPECT_TRUE(Answers().empty());
  proto::Message storage;
  storage.mutable_storage_status()->set_database_bytes(4096);
  AnswerAs(actor_name::kStorage, Asked(actor_name::kStorage), storage);
  EXPECT_TRUE(Answers().empty());
  proto::Message leases;
  leases.mutable_leases_changed()->add_leases()->set_agent_id(2);
  AnswerAs(actor_name::kLease, Asked(actor_name::kLease), leases);

  const proto::AgentStatus status = OnlyAnswer().status();
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

TEST_F(GatewayActorTest, AddsUpTheShareStatusOfSyncAndReplication) {
  proto::ControlRequest request;
  request.mutable_share_status();
  Request(request);
  proto::Message part;
  part.mutable_share_status()->add_sessions()->set_destination(2);
  part.mutable_share_status()->set_received_records(3);
  AnswerAs(actor_name::kSync, Asked(actor_name::kSync), part);
  AnswerAs(actor_name::kReplica, Asked(actor_name::kReplica), part);
  const proto::ShareStatus status = OnlyAnswer().share_status();
  EXPECT_EQ(status.sessions_size(), 2);
  EXPECT_EQ(status.received_records(), 6);
}

TEST_F(GatewayActorTest, AsksStorageWhatItHoldsAndWhetherItIsSound) {
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

TEST_F(GatewayActorTest, WaitsLongForTheCheckOfAFile) {
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
  EXPECT_TRUE(team_.Take({1, actor_name::kSync}).empty());
  EXPECT_TRUE(Asked(actor_name::kReplica).has_share_request());
}

TEST_F(GatewayActorTest, PassesALeaseOnAndItsErrorBack) {
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

TEST_F(GatewayActorTest, AnswersWhatIsNoRequestAtOnce) {
  Request({});
  EXPECT_EQ(OnlyAnswer().error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(GatewayActorTest, AnswersForAnActorThatKeepsSilentInTime) {
  proto::ControlRequest request;
  request.mutable_status();
  Request(request);
  Request(Optimize(), 6);
  team_.AdvanceTime(seconds(59));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(2));
  const proto::ControlReply status = OnlyAnswer();
  EXPECT_EQ(status.error().code(), proto::ERROR_CODE_TIMED_OUT);
  EXPECT_EQ(status.error().text(), "lease and role and storage did not answer in time");
  // Solving may take ten minutes.
  team_.AdvanceTime(seconds(535));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(OnlyAnswer(6).error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(GatewayActorTest, BoundsWhatWaitsAndMakesRoomAgain) {
  for (std::uint64_t id = 1; id <= 4; ++id) Request(Optimize(), id);
  EXPECT_TRUE(Answers().empty());
  Request(Optimize(), 5);
  EXPECT_EQ(OnlyAnswer(5).error().code(), proto::ERROR_CODE_FULL);
  const auto asked = team_.Take({1, actor_name::kPgo});
  ASSERT_EQ(asked.size(), 4u);
  proto::Message answer;
  answer.mutable_optimize_reply();
  AnswerAs(actor_name::kPgo, asked[0], answer);
  EXPECT_TRUE(OnlyAnswer(1).has_optimize());
  Request(Optimize(), 6);
  EXPECT_TRUE(Answers().empty());
}

TEST_F(GatewayActorTest, IgnoresAnswersThatNobodyAskedFor) {
  Request(Optimize());
  const proto::Message asked = Asked(actor_name::kPgo);
  proto::Message answer;
  answer.mutable_optimize_reply();
  AnswerAs(actor_name::kMerge, asked, answer);  // Of another actor.
  proto::Message other = asked;
  other.set_request_id(asked.request_id() + 1);
  AnswerAs(actor_name::kPgo, other, answer);  // Of another request.
  answer.set_request_id(asked.request_id());
  (void)team_.Post({2, actor_name::kPgo}, gateway_, answer);  // Of another agent.
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(Answers().empty());
  AnswerAs(actor_name::kPgo, asked, answer);
  EXPECT_TRUE(OnlyAnswer().has_optimize());
  AnswerAs(actor_name::kPgo, asked, answer);  // A second time.
  EXPECT_TRUE(Answers().empty());
}

TEST_F(GatewayActorTest, RefusesTheRequestOfAnotherAgent) {
  const Address other{2, "client"};
  RequestAs(other, Optimize(), 5);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(team_.Take({1, actor_name::kPgo}).empty());
  const auto answers = team_.Take(other);
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].control_reply().error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(GatewayActorTest, RepliesToAStopBeforeItStops) {
  proto::ControlRequest request;
  request.mutable_stop();
  Request(request);
  EXPECT_TRUE(OnlyAnswer().has_stop());
}

}  // namespace
}  // namespace moondb
