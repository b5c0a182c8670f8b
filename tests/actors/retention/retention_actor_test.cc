#include "actors/retention/retention_actor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "actors/role/role_actor.h"
#include "actors/storage/storage_actor.h"
#include "model/control_message.h"
#include "proto/control.pb.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;
constexpr AgentId kRover = 3;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

bool AsksForHave(const proto::Message& message) {
  const auto request = ControlRequestOf(message);
  return request && request->has_have();
}

// Rover 1 is the leader, rover 2 the survivor, and rover 3 has no role. Each rover runs StorageActor, RoleActor and
// RetentionActor. The tests copy records between the rovers with Bring, and answer in the merge actor's place with
// AnswerMerge.
class RetentionActorTest : public testing::Test {
 protected:
  RetentionActorTest() {
    config_.set_team("test");
    for (AgentId agent = 1; agent <= 3; ++agent) {
      config_.add_agents()->set_id(agent);
      config_.mutable_agents()->rbegin()->set_name("rover" + std::to_string(agent));
    }
    config_.mutable_roles()->set_leader("rover1");
    config_.mutable_roles()->set_survivor("rover2");
    (*config_.mutable_share())["agent_event"] = proto::POLICY_ALL;
    (*config_.mutable_share())["health"] = proto::POLICY_ALL;
    (*config_.mutable_share())["local_traversability_map"] = proto::POLICY_ALL;
    (*config_.mutable_share())["pose_graph_node"] = proto::POLICY_ALL;
    (*config_.mutable_share())["power"] = proto::POLICY_LATEST;
  }

  void Start() {
    for (AgentId agent = 1; agent <= 3; ++agent) team_.AddAgent(agent);
    for (AgentId agent = 1; agent <= 3; ++agent) {
      StorageActor::Options storage;
      storage.path = folder_.File(std::to_string(agent) + ".db");
      Spawn<StorageActor>(agent, actor_name::kStorage, storage);
      Spawn<RoleActor>(agent, actor_name::kRole, RoleActor::Options());
      RetentionActor::Options retention;
      Spawn<RetentionActor>(agent, actor_name::kRetention, retention);
    }
    team_.AdvanceTime(seconds(1));
    team_.Watch({kRover, "reader"}, Topic::kStored);
  }

  template <typename ActorType, typename Options>
  void Spawn(AgentId agent, const char* name, Options options) {
    options.self = agent;
    options.team = config_;
    team_.Spawn(agent, name, [options] { return std::make_unique<ActorType>(options); });
  }

  proto::Message Ask(AgentId agent, const char* actor, proto::Message question) {
    (void)team_.TakeMessages({agent, "requester"});
    (void)team_.Post({agent, "requester"}, {agent, actor}, std::move(question));
    team_.RunUntilIdle();
    const std::vector<proto::Message> answers = team_.TakeMessages({agent, "requester"});
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? proto::Message() : answers.front();
  }

  void Insert(AgentId agent, const proto::Record& record) {
    proto::Message message;
    *message.mutable_insert_request()->add_records() = record;
    const proto::Message answer = Ask(agent, actor_name::kStorage, std::move(message));
    EXPECT_FALSE(IsError(answer.insert_reply().error())) << answer.DebugString();
  }

  proto::Record ReportOf(std::int64_t age_days, const std::string& text = "it was so") {
    proto::Record record;
    record.set_timestamp_ns(team_.utc_now_ns() - age_days * kDay_ns);
    record.mutable_health()->set_level(proto::HEALTH_LEVEL_NOMINAL);
    record.mutable_health()->set_text(text);
    return record;
  }

  proto::Record EventOf(std::int64_t age_days) {
    proto::Record record;
    record.set_timestamp_ns(team_.utc_now_ns() - age_days * kDay_ns);
    record.mutable_agent_event()->set_kind(proto::EVENT_KIND_COMMAND);
    record.mutable_agent_event()->set_text("it was so");
    return record;
  }

  // Sends a role change to kLeader, and waits until all agents know the new roles.
  void SetRoles(AgentId leader, AgentId survivor) {
    proto::Message message;
    message.mutable_role_set_request()->set_leader(leader);
    message.mutable_role_set_request()->set_survivor(survivor);
    (void)Ask(kLeader, actor_name::kRole, std::move(message));
    team_.AdvanceTime(seconds(10));
  }

  proto::Record MapOf(AgentId agent, std::uint64_t index, std::int64_t age_days, std::size_t cells = 65536) {
    proto::Record record;
    record.set_timestamp_ns(team_.utc_now_ns() - age_days * kDay_ns);
    proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
    map.mutable_node()->set_agent_id(agent);
    map.mutable_node()->set_index(index);
    map.mutable_node_from_map()->mutable_position_m();
    map.mutable_node_from_map()->mutable_orientation()->set_w(1);
    proto::MapLayer& layer = *map.add_layers();
    layer.set_width_cells(8);
    layer.set_height_cells(static_cast<std::uint32_t>(cells / 8));
    layer.set_resolution_um(50'000);
    layer.set_cells(std::string((cells + 3) / 4, '\x12'));
    return record;
  }

  std::vector<proto::StoredRecord> RecordsOf(AgentId agent) {
    std::vector<proto::StoredRecord> records;
    proto::Message question;
    question.mutable_read_request();
    while (true) {
      const proto::ReadReply reply = Ask(agent, actor_name::kStorage, question).read_reply();
      records.insert(records.end(), reply.records().begin(), reply.records().end());
      if (reply.is_complete() || reply.row_ids().empty()) return records;
      question.mutable_read_request()->set_after_row_id(*reply.row_ids().rbegin());
    }
  }

  std::size_t CountOf(AgentId agent, DataType type) {
    const auto records = RecordsOf(agent);
    return static_cast<std::size_t>(std::count_if(
        records.begin(), records.end(), [type](const auto& record) { return record.key().data_type() == type; }));
  }

  void Transfer(AgentId from, AgentId to) {
    proto::Message message;
    message.mutable_store_request()->set_sender(from);
    for (const proto::StoredRecord& record : RecordsOf(from)) *message.mutable_store_request()->add_records() = record;
    (void)Ask(to, actor_name::kStorage, std::move(message));
  }

  void InsertOldMapEverywhere() {
    Insert(kRover, MapOf(kRover, 1, 1, 64));
    Transfer(kRover, kLeader);
    Transfer(kRover, kSurvivor);
  }

  // Waits a minute. Returns true if the rover's storage has reported a prune since the last call.
  bool HearsOfPruned() {
    team_.AdvanceTime(minutes(1));
    const std::vector<proto::Message> heard = team_.TakeMessages({kRover, "reader"});
    return std::any_of(heard.begin(), heard.end(),
                       [](const proto::Message& message) { return message.records_stored().is_pruned(); });
  }

  // Makes `actor` fail with `fault` at its next message with this body. The actor fails only once.
  void FailOnce(const Address& actor, proto::Message::BodyCase body, simulation::Fault fault) {
    team_.SetFault([actor, body, fault, is_done = false](const Address& at, const proto::Message& message) mutable {
      if (is_done || at != actor || message.body_case() != body) return simulation::Fault::kNone;
      is_done = true;
      return fault;
    });
  }

  void Order(AgentId agent, proto::PruneOrder order) {
    proto::Message message;
    message.set_request_id(77);
    *message.mutable_prune_order() = std::move(order);
    (void)team_.Post({agent, actor_name::kGateway}, {agent, actor_name::kRetention}, std::move(message));
  }

  proto::PruneReply Prune(AgentId agent, const proto::PruneOrder& order = {}) {
    Order(agent, order);
    const auto answer = team_.Expect({agent, actor_name::kGateway}, proto::Message::kPruneReply, minutes(5));
    EXPECT_TRUE(answer);
    if (!answer) return {};
    EXPECT_EQ(answer->request_id(), 77u);
    return answer->prune_reply();
  }

  static double GoneOf(const proto::PruneReply& reply) {
    double count = 0;
    for (const proto::PrunedType& pruned : reply.pruned()) count += pruned.record_count();
    return count;
  }

  proto::StorageStatus StatusOf(AgentId agent) {
    proto::ControlRequest question;
    question.mutable_status();
    const auto answer = ControlReplyOf(Ask(agent, actor_name::kStorage, MessageOf(question)));
    EXPECT_TRUE(answer);
    return answer ? answer->status().storage() : proto::StorageStatus();
  }

  // Sets whether the radio loses all have-sets from now on.
  void LoseHaveSets(bool is_lost) {
    team_.SetFilter([is_lost](AgentId, AgentId, const proto::Message& message) {
      const auto reply = ControlReplyOf(message);
      return !is_lost || !reply || !reply->has_have();
    });
  }

  void AnswerMerge(AgentId agent, const std::vector<proto::RecordKey>& occluded) {
    const auto asked = team_.Expect({agent, actor_name::kMerge}, proto::Message::kOccludedMapsRequest, minutes(1));
    ASSERT_TRUE(asked);
    proto::Message answer;
    answer.set_request_id(asked->request_id());
    *answer.mutable_occluded_maps_reply()->mutable_records() = {occluded.begin(), occluded.end()};
    (void)team_.Post({agent, actor_name::kMerge}, {agent, actor_name::kRetention}, std::move(answer));
  }

  TemporaryFolder folder_;
  proto::TeamConfig config_;
  simulation::SimulatedTeam team_{1};
};

TEST_F(RetentionActorTest, RemovesRecordsThatLeaderAndSurvivorHaveNow) {
  Start();
  Insert(kRover, ReportOf(1, "both"));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  Insert(kRover, ReportOf(1, "leader alone"));
  Transfer(kRover, kLeader);
  const proto::PruneReply reply = Prune(kRover);
  EXPECT_EQ(reply.text(), "");
  EXPECT_TRUE(reply.is_complete());
  EXPECT_EQ(GoneOf(reply), 1);
  EXPECT_EQ(reply.unacknowledged_count(), 1);
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
  EXPECT_EQ(RecordsOf(kLeader).size(), 2u);
}

TEST_F(RetentionActorTest, LeaderAndSurvivorAskOnlyEachOther) {
  Start();
  Insert(kLeader, ReportOf(1));
  Transfer(kLeader, kSurvivor);
  team_.SetLink(kLeader, kRover, false);
  EXPECT_EQ(GoneOf(Prune(kLeader)), 1);
  team_.SetLink(kSurvivor, kRover, false);
  EXPECT_EQ(GoneOf(Prune(kSurvivor)), 0) << "the last copy went without being old";
  proto::PruneOrder by_age;
  by_age.set_older_than_s(1);
  EXPECT_EQ(GoneOf(Prune(kSurvivor, by_age)), 1);
}

TEST_F(RetentionActorTest, OneOfTwoAgentsThatPruneTheSameRecordAtOnceKeepsIt) {
  Start();
  Insert(kLeader, ReportOf(1));
  Transfer(kLeader, kSurvivor);
  Order(kLeader, {});
  Order(kSurvivor, {});
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(RecordsOf(kLeader).size() + RecordsOf(kSurvivor).size(), 1u);
}

TEST_F(RetentionActorTest, RemovesNothingWhileTheSurvivorCannotBeReached) {
  Start();
  Insert(kRover, ReportOf(1));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.SetLink(kRover, kSurvivor, false);
  const proto::PruneReply reply = Prune(kRover);
  EXPECT_EQ(reply.text(), "rover2, the designated survivor, cannot be reached");
  EXPECT_EQ(GoneOf(reply), 0);
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
  team_.SetLink(kRover, kSurvivor, true);
  EXPECT_EQ(GoneOf(Prune(kRover)), 1);
}

TEST_F(RetentionActorTest, RemovesNothingWhileTheLeaderIsSilent) {
  Start();
  Insert(kRover, ReportOf(1));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.SetLink(kRover, kLeader, false, /*tell=*/false);
  EXPECT_EQ(Prune(kRover).text(), "rover1, the leader, did not answer in time");
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
}

TEST_F(RetentionActorTest, RemovesNothingWithoutASurvivor) {
  config_.mutable_roles()->clear_survivor();
  Start();
  Insert(kRover, ReportOf(1));
  EXPECT_EQ(Prune(kRover).text(), "the team has no designated survivor");
}

TEST_F(RetentionActorTest, AsksNoAgentThatHasLeft) {
  config_.mutable_agents(1)->set_left(true);
  Start();
  team_.AdvanceTime(minutes(11));
  EXPECT_EQ(Prune(kRover).text(), "rover2, the designated survivor, has left the team");
}

TEST_F(RetentionActorTest, RefusesAnInvalidHaveSet) {
  Start();
  Insert(kRover, ReportOf(1));
  LoseHaveSets(true);
  std::uint64_t request_id = 0;
  team_.RecordSent({kRover, actor_name::kRetention});
  Order(kRover, {});
  team_.AdvanceTime(seconds(2));
  for (const proto::Message& sent : team_.TakeSent({kRover, actor_name::kRetention})) {
    if (AsksForHave(sent)) request_id = sent.request_id();
  }
  ASSERT_NE(request_id, 0u);
  proto::ControlReply lie;
  proto::StreamHave& stream = *lie.mutable_have()->mutable_have()->add_streams();
  stream.set_origin_agent(kRover);
  stream.set_epoch(1);
  stream.set_data_type(proto::HEALTH);
  stream.add_held()->set_first(5);
  LoseHaveSets(false);
  proto::Message message = MessageOf(lie);
  message.set_request_id(request_id);
  (void)team_.Post({kLeader, actor_name::kRetention}, {kRover, actor_name::kRetention}, std::move(message));
  const auto answer = team_.Expect({kRover, actor_name::kGateway}, proto::Message::kPruneReply, seconds(1));
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->prune_reply().text().starts_with("rover1, the leader, sent an invalid have-set: "))
      << answer->prune_reply().text();
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
}

TEST_F(RetentionActorTest, AcceptsAnswersOnlyFromTheAgentsThatItAsked) {
  Start();
  Insert(kLeader, ReportOf(1));
  LoseHaveSets(true);
  team_.RecordSent({kLeader, actor_name::kRetention});
  Order(kLeader, {});
  team_.AdvanceTime(seconds(2));
  std::uint64_t request_id = 0;
  for (const proto::Message& sent : team_.TakeSent({kLeader, actor_name::kRetention})) {
    if (AsksForHave(sent)) request_id = sent.request_id();
  }
  proto::ControlReply claim;
  for (const proto::StoredRecord& record : RecordsOf(kLeader)) {
    proto::StreamHave& stream = *claim.mutable_have()->mutable_have()->add_streams();
    stream.set_origin_agent(kLeader);
    stream.set_epoch(record.key().epoch());
    stream.set_data_type(proto::HEALTH);
    stream.add_held()->set_first(1);
    stream.mutable_held(0)->set_last(1);
  }
  LoseHaveSets(false);
  proto::Message message = MessageOf(claim);
  message.set_request_id(request_id);
  (void)team_.Post({kRover, actor_name::kRetention}, {kLeader, actor_name::kRetention}, message);
  (void)team_.Post({kSurvivor, "impostor"}, {kLeader, actor_name::kRetention}, message);
  const auto answer = team_.Expect({kLeader, actor_name::kGateway}, proto::Message::kPruneReply, minutes(1));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->prune_reply().text(), "rover2, the designated survivor, did not answer in time");
  EXPECT_EQ(RecordsOf(kLeader).size(), 1u);
}

TEST_F(RetentionActorTest, AcceptsOneOrderAtATime) {
  Start();
  Order(kRover, {});
  const proto::PruneReply second = Prune(kRover);
  EXPECT_NE(second.error().text().find("prunes already"), std::string::npos);
  const auto first = team_.Expect({kRover, actor_name::kGateway}, proto::Message::kPruneReply, minutes(1));
  ASSERT_TRUE(first);
  EXPECT_FALSE(IsError(first->prune_reply().error()));
}

// The rover does not share its history, so it may prune the history without asking another agent.
TEST_F(RetentionActorTest, RemovesHistoryThoughLeaderAndSurvivorCannotBeReached) {
  (*config_.mutable_keep())["power"] = "all";
  config_.mutable_retention()->set_history_mb_max(1);
  Start();
  team_.SetLink(kRover, kLeader, false);
  team_.SetLink(kRover, kSurvivor, false);
  proto::Record power;
  power.mutable_power()->set_battery_ratio(0.5);
  for (const std::int64_t age_days : {10, 5, 1}) {
    power.set_timestamp_ns(team_.utc_now_ns() - age_days * kDay_ns);
    Insert(kRover, power);
  }
  proto::Message order;
  order.mutable_prune_order()->set_is_history(true);
  order.mutable_prune_order()->set_older_than_s(7 * 86400.0);
  order.mutable_prune_order()->add_data_types(proto::POWER);
  proto::PruneReply reply = Ask(kRover, actor_name::kRetention, order).prune_reply();
  EXPECT_EQ(reply.text(), "");
  ASSERT_EQ(reply.pruned_size(), 1) << reply.DebugString();
  EXPECT_EQ(reply.pruned(0).record_count(), 1);
  EXPECT_TRUE(reply.is_complete());
  order.mutable_prune_order()->clear_older_than_s();
  reply = Ask(kRover, actor_name::kRetention, order).prune_reply();
  ASSERT_EQ(reply.pruned_size(), 1) << reply.DebugString();
  EXPECT_EQ(reply.pruned(0).record_count(), 1);
  EXPECT_EQ(CountOf(kRover, proto::POWER), 1u) << "what is held stays";
}

TEST_F(RetentionActorTest, RefusesTypesThatAreNeverPruned) {
  Start();
  proto::PruneOrder order;
  order.add_data_types(proto::POWER);
  const proto::PruneReply reply = Prune(kRover, order);
  EXPECT_EQ(reply.error().field(), "prune.data_types[0]") << reply.DebugString();
}

TEST_F(RetentionActorTest, RemovesNothingByAgeWhileItsClockIsSuspect) {
  Start();
  Insert(kRover, ReportOf(1));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.SetUtcOffset(kRover, std::chrono::hours(24 * 365));
  proto::PruneOrder order;
  order.set_older_than_s(30 * 86400);
  EXPECT_NE(Prune(kRover, order).text().find("clock is suspect"), std::string::npos);
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
}

TEST_F(RetentionActorTest, AnOrderRemovesNoEvents) {
  Start();
  Insert(kRover, EventOf(31));
  Insert(kRover, ReportOf(31));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  proto::PruneOrder order;
  order.add_data_types(proto::AGENT_EVENT);
  const proto::PruneReply refused = Prune(kRover, order);
  EXPECT_EQ(refused.error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(refused.error().field(), "prune.data_types[0]");
  EXPECT_EQ(CountOf(kRover, proto::AGENT_EVENT), 1u);
  Prune(kRover, {});
  EXPECT_EQ(CountOf(kRover, proto::AGENT_EVENT), 1u) << "all types are all but these";
  EXPECT_EQ(CountOf(kRover, proto::HEALTH), 0u);
}

TEST_F(RetentionActorTest, RemovesNothingForTenMinutesAfterLeaderOrSurvivorChanged) {
  Start();
  Insert(kRover, ReportOf(31));
  for (const AgentId agent : {kLeader, kSurvivor}) Transfer(kRover, agent);
  SetRoles(kLeader, kRover);
  EXPECT_NE(Prune(kSurvivor, {}).text().find("changed within the last 10 minutes"), std::string::npos);
  EXPECT_EQ(RecordsOf(kSurvivor).size(), 1u);
  team_.AdvanceTime(minutes(11));
  Prune(kSurvivor, {});
  EXPECT_EQ(RecordsOf(kSurvivor).size(), 0u);
}

TEST_F(RetentionActorTest, AppliesTheTeamFilesAgesPeriodically) {
  config_.mutable_retention()->set_keep_event_days(30);
  Start();
  Insert(kRover, EventOf(31));
  Insert(kRover, EventOf(29));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.AdvanceTime(minutes(4));
  EXPECT_EQ(RecordsOf(kRover).size(), 2u);
  team_.AdvanceTime(minutes(7));
  EXPECT_EQ(StatusOf(kRover).pruned_count(), 1);
  const std::vector<proto::StoredRecord> left = RecordsOf(kRover);
  ASSERT_EQ(left.size(), 2u);
  proto::Record event;
  ASSERT_TRUE(event.ParseFromString(left[1].content()));
  EXPECT_EQ(event.agent_event().kind(), proto::EVENT_KIND_PRUNED);
  EXPECT_EQ(event.agent_event().text(), "removed 1 records because of their age: agent_event 1");
}

// The robot's software gives times from 0 or from 2039, as in simulated time: such records have no age.
TEST_F(RetentionActorTest, RemovesNothingByAgeThatHasNoRightTimestamp) {
  config_.mutable_retention()->set_keep_days(1);
  Start();
  for (const std::int64_t seconds_since_1970 : {0LL, 12LL, 1'000'000'000LL, 2'177'452'800LL}) {
    for (proto::Record record : {ReportOf(0), MapOf(kRover, 1, 0, 64)}) {
      record.set_timestamp_ns(seconds_since_1970 * 1'000'000'000);
      Insert(kRover, record);
    }
  }
  const std::size_t count = RecordsOf(kRover).size();
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.AdvanceTime(std::chrono::hours(72));
  for (const AgentId agent : {kRover, kLeader, kSurvivor}) {
    EXPECT_EQ(StatusOf(agent).pruned_count(), 0) << agent;
    EXPECT_EQ(RecordsOf(agent).size(), count) << agent;
  }
}

TEST_F(RetentionActorTest, TriesAgainWhenTheOtherAgentsReturn) {
  config_.mutable_retention()->set_keep_days(30);
  Start();
  Insert(kRover, ReportOf(31));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.SetLink(kRover, kLeader, false);
  team_.AdvanceTime(minutes(25));
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
  team_.SetLink(kRover, kLeader, true);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(StatusOf(kRover).pruned_count(), 1);
}

TEST_F(RetentionActorTest, AsksNoAgentIfTheTeamFileSetsNoLimits) {
  Start();
  const std::uint64_t bytes = team_.radio_bytes();
  team_.AdvanceTime(minutes(60));
  team_.SetFilter([](AgentId, AgentId, const proto::Message& message) {
    EXPECT_FALSE(AsksForHave(message));
    return true;
  });
  team_.AdvanceTime(minutes(60));
  EXPECT_LT(team_.radio_bytes() - bytes, 10'000u);
}

// The store may use 1 MB, half of it for maps. The maps use 0.75 MB, and all other records less than 0.5 MB.
TEST_F(RetentionActorTest, RemovesMapsFirstAndKeepsGraphAndStates) {
  config_.mutable_retention()->set_store_mb_max(1);
  config_.mutable_retention()->set_map_part_max(0.5);
  Start();
  proto::Record power;
  power.set_timestamp_ns(1);
  power.mutable_power()->set_battery_ratio(0.5);
  Insert(kRover, power);
  proto::Record node;
  node.set_timestamp_ns(1);
  node.mutable_pose_graph_node()->mutable_node()->set_agent_id(kRover);
  node.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m();
  node.mutable_pose_graph_node()->mutable_map_from_node()->mutable_orientation()->set_w(1);
  Insert(kRover, node);
  for (int i = 0; i < 100; ++i) Insert(kRover, ReportOf(300));
  for (int i = 0; StatusOf(kRover).map_bytes() < 0.65e6; ++i) Insert(kRover, MapOf(kRover, 1, 200 - i));
  const std::size_t maps = CountOf(kRover, proto::LOCAL_TRAVERSABILITY_MAP);
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.AdvanceTime(minutes(11));
  const proto::StorageStatus after = StatusOf(kRover);
  EXPECT_LT(CountOf(kRover, proto::LOCAL_TRAVERSABILITY_MAP), maps);
  EXPECT_LE(after.map_bytes(), 0.7e6);
  EXPECT_GT(after.map_bytes(), 0.2e6);
  EXPECT_EQ(CountOf(kRover, proto::HEALTH), 100u) << "older than the maps, but within their part";
  EXPECT_EQ(CountOf(kRover, proto::POWER), 1u);
  EXPECT_EQ(CountOf(kRover, proto::POSE_GRAPH_NODE), 1u);
  EXPECT_EQ(after.space_low(), "");
}

TEST_F(RetentionActorTest, ReportsThatSpaceIsLowIfNothingMayBeRemoved) {
  config_.mutable_retention()->set_store_mb_max(1);
  config_.mutable_retention()->set_map_part_max(0.5);
  Start();
  for (int i = 0; StatusOf(kRover).database_bytes() - StatusOf(kRover).wal_bytes() <= 0.95e6; ++i) {
    Insert(kRover, MapOf(kRover, 1, 200 - i));
    ASSERT_LT(i, 1000);
  }
  const std::size_t maps = CountOf(kRover, proto::LOCAL_TRAVERSABILITY_MAP);
  team_.AdvanceTime(minutes(11));
  EXPECT_EQ(CountOf(kRover, proto::LOCAL_TRAVERSABILITY_MAP), maps);
  EXPECT_NE(StatusOf(kRover).space_low().find("of retention.store_mb_max"), std::string::npos);
  EXPECT_EQ(StatusOf(kRover).database_bytes_max(), 1e6);
}

TEST_F(RetentionActorTest, RemovesFullyOccludedMaps) {
  Start();
  for (std::uint64_t i = 1; i <= 3; ++i) Insert(kRover, MapOf(kRover, i, 1, 64));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  const proto::RecordKey occluded = RecordsOf(kRover)[1].key();
  proto::PruneOrder order;
  order.set_occluded_maps(true);
  Order(kRover, order);
  AnswerMerge(kRover, {occluded});
  const auto answer = team_.Expect({kRover, actor_name::kGateway}, proto::Message::kPruneReply, seconds(1));
  ASSERT_TRUE(answer);
  EXPECT_EQ(GoneOf(answer->prune_reply()), 1);
  EXPECT_TRUE(HearsOfPruned());
  for (const proto::StoredRecord& left : RecordsOf(kRover)) EXPECT_NE(left.key().seq(), occluded.seq());
}

// The merge actor keeps the records that it has read, so storage must notify it of every prune.
TEST_F(RetentionActorTest, ReadersHearOfAPruneOfAnyType) {
  Start();
  Insert(kRover, ReportOf(1));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  EXPECT_FALSE(HearsOfPruned());
  proto::PruneOrder order;
  order.set_is_dry_run(true);
  EXPECT_EQ(GoneOf(Prune(kRover, order)), 1);
  EXPECT_FALSE(HearsOfPruned());
  EXPECT_EQ(GoneOf(Prune(kRover)), 1);
  EXPECT_TRUE(HearsOfPruned());
  EXPECT_EQ(GoneOf(Prune(kRover)), 0);
  EXPECT_FALSE(HearsOfPruned());
}

TEST_F(RetentionActorTest, ReadersHearOfAPruneThoughTheActorFailsAfterIt) {
  Start();
  InsertOldMapEverywhere();
  FailOnce({kRover, actor_name::kRetention}, proto::Message::kPruneReply, simulation::Fault::kBeforeHandler);
  Order(kRover, {});
  EXPECT_TRUE(HearsOfPruned());
  EXPECT_TRUE(RecordsOf(kRover).empty());
}

TEST_F(RetentionActorTest, ReadersHearOfAPruneBeforeTheRestartOfStorage) {
  Start();
  InsertOldMapEverywhere();
  FailOnce({kRover, actor_name::kStorage}, proto::Message::kPruneRequest, simulation::Fault::kAtFirstSend);
  EXPECT_EQ(Prune(kRover).error().code(), proto::ERROR_CODE_TIMED_OUT);
  EXPECT_TRUE(RecordsOf(kRover).empty());
  EXPECT_TRUE(HearsOfPruned());
}

TEST_F(RetentionActorTest, RemovesNothingIfNoMapIsFullyOccluded) {
  Start();
  Insert(kRover, MapOf(kRover, 1, 1, 64));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  proto::PruneOrder order;
  order.set_occluded_maps(true);
  Order(kRover, order);
  AnswerMerge(kRover, {});
  const auto answer = team_.Expect({kRover, actor_name::kGateway}, proto::Message::kPruneReply, seconds(1));
  ASSERT_TRUE(answer);
  EXPECT_EQ(GoneOf(answer->prune_reply()), 0);
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
}

TEST_F(RetentionActorTest, ReportsWhyMergeCouldNotAnswer) {
  Start();
  proto::PruneOrder order;
  order.set_occluded_maps(true);
  Order(kRover, order);
  const auto asked = team_.Expect({kRover, actor_name::kMerge}, proto::Message::kOccludedMapsRequest, minutes(1));
  ASSERT_TRUE(asked);
  proto::Message answer = ErrorMessage({ErrorCode::kFull, "too much waits", {}});
  answer.set_request_id(asked->request_id());
  (void)team_.Post({kRover, actor_name::kMerge}, {kRover, actor_name::kRetention}, std::move(answer));
  const auto reply = team_.Expect({kRover, actor_name::kGateway}, proto::Message::kPruneReply, seconds(1));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->prune_reply().error().text(), "too much waits");
}

TEST_F(RetentionActorTest, ContinuesAfterARestartDuringAPrune) {
  Start();
  Insert(kRover, ReportOf(1));
  Transfer(kRover, kLeader);
  Transfer(kRover, kSurvivor);
  team_.SetFilter([](AgentId, AgentId, const proto::Message& message) {
    return message.body_case() != proto::Message::kControlReply;
  });
  Order(kRover, {});
  team_.AdvanceTime(seconds(5));  // The rover asks leader and survivor, but the radio loses their answers.
  team_.CrashActor({kRover, actor_name::kRetention});
  team_.SetFilter(nullptr);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(RecordsOf(kRover).size(), 1u);
  EXPECT_EQ(GoneOf(Prune(kRover)), 1);
  EXPECT_TRUE(RecordsOf(kRover).empty());
}

}  // namespace
}  // namespace moondb
