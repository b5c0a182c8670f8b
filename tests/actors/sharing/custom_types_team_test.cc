// Tests records of custom data types in a team of leader, survivor, rover and base station. All agents run the real
// StorageActor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "actors/role/role_actor.h"
#include "actors/storage/storage_actor.h"
#include "proto/share_status.pb.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;
using testing::ElementsAre;

constexpr AgentId kLeader = 1, kSurvivor = 2, kRover = 3, kBase = 4;
// Leader and survivor get all soil records. The base station gets only the newest record of each key.
constexpr DataType kSoil = 1000;
// Leader and survivor get only the newest beacon record of each key. The base station gets none.
constexpr DataType kBeacon = 1001;

proto::TeamConfig TeamWithTypes() {
  proto::TeamConfig team = TestTeam(3);
  for (const auto& [id, name, share] :
       {std::tuple(kSoil, "soil", proto::POLICY_ALL), std::tuple(kBeacon, "beacon", proto::POLICY_LATEST)}) {
    proto::CustomType& type = *team.add_custom_types();
    type.set_id(id);
    type.set_name(name);
    type.set_share(share);
    type.set_ground(id == kSoil ? proto::POLICY_LATEST : proto::POLICY_NONE);
    type.set_priority(5);
    type.set_bytes_max(4096);
  }
  return team;
}

class CustomTypesTeamTest : public testing::Test {
 protected:
  void Start(AgentId without_types) {
    team_.SetBaseStation(kBase);
    for (AgentId agent = 1; agent <= kBase; ++agent) {
      proto::TeamConfig config = agent == without_types ? TestTeam(3) : TeamWithTypes();
      if (agent == other_name_at_) config.mutable_custom_types(0)->set_name("rocks");
      team_.AddAgent(agent);
      StorageActor::Options storage;
      storage.path = ":memory:";
      storage.self = agent;
      storage.team = config;
      team_.Watch({agent, "listener"}, Topic::kStored);
      team_.Spawn(agent, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
      RoleActor::Options role;
      role.self = agent;
      role.team = config;
      team_.Spawn(agent, actor_name::kRole, [role] { return std::make_unique<RoleActor>(role); });
      SpawnSharing(team_, agent, config);
    }
    team_.AdvanceTime(seconds(10));
  }

  void Insert(AgentId agent, DataType type, const std::string& payload, const std::string& latest_key = {}) {
    proto::Message question;
    proto::CustomRecord& custom = *question.mutable_insert_request()->add_records()->mutable_custom();
    custom.set_data_type(type);
    custom.set_payload(payload);
    custom.set_latest_key(latest_key);
    const proto::Message answer = Ask(agent, question);
    EXPECT_FALSE(IsError(answer.insert_reply().error())) << answer.ShortDebugString();
  }

  std::vector<std::string> PayloadsAt(AgentId agent, DataType type) {
    proto::Message question;
    question.mutable_read_request()->add_data_types(type);
    std::vector<std::string> payloads;
    const proto::Message answer = Ask(agent, question);
    for (const proto::StoredRecord& stored : answer.read_reply().records()) {
      proto::Record record;
      EXPECT_TRUE(record.ParseFromString(stored.content()));
      EXPECT_EQ(stored.key().data_type(), type);
      payloads.push_back(record.custom().payload());
    }
    return payloads;
  }

  void SyncAndReplicate() {
    for (const proto::SharingKind kind : {proto::SHARING_KIND_SYNC, proto::SHARING_KIND_REPLICATION}) {
      const proto::ShareReply reply = Share(team_, kLeader, ShareOrder(kind));
      EXPECT_FALSE(IsError(reply.error())) << reply.ShortDebugString();
      team_.AdvanceTime(minutes(1));
    }
  }

  double SentRecords() {
    double sent = 0;
    for (AgentId agent = 1; agent <= kBase; ++agent) {
      for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
        const proto::ShareStatus status = ShareStatusOf(team_, agent, actor);
        for (const proto::ShareSession& session : status.sessions()) {
          sent += session.sent_records();
          EXPECT_FALSE(session.is_open()) << session.ShortDebugString();
        }
        EXPECT_EQ(status.rejected_records(), 0) << "agent " << agent;
      }
    }
    return sent;
  }

  proto::Message Ask(AgentId agent, const proto::Message& question) {
    (void)team_.Post({agent, "client"}, {agent, actor_name::kStorage}, question);
    team_.RunUntilIdle();
    const auto answers = team_.TakeMessages({agent, "client"});
    return answers.empty() ? proto::Message() : answers.back();
  }

  AgentId other_name_at_ = 0;  // Agent whose team file gives kSoil another name; 0: none.
  simulation::SimulatedTeam team_{/*seed=*/5};
};

TEST_F(CustomTypesTeamTest, SendsARoversRecordsToLeaderSurvivorAndBaseByPolicy) {
  Start(/*without_types=*/0);
  Insert(kRover, kSoil, "hole 1, dry", "hole 1");
  Insert(kRover, kBeacon, "at 1", "beacon 7");
  SyncAndReplicate();
  Insert(kRover, kSoil, "hole 1, wet", "hole 1");
  Insert(kRover, kBeacon, "at 2", "beacon 7");
  SyncAndReplicate();
  for (const AgentId agent : {kLeader, kSurvivor}) {
    EXPECT_THAT(PayloadsAt(agent, kSoil), ElementsAre("hole 1, dry", "hole 1, wet")) << agent;
    EXPECT_THAT(PayloadsAt(agent, kBeacon), ElementsAre("at 2")) << "the superseded one is dropped at " << agent;
  }
  EXPECT_TRUE(PayloadsAt(kBase, kBeacon).empty());
  EXPECT_EQ(PayloadsAt(kBase, kSoil).back(), "hole 1, wet");
  const double sent = SentRecords();
  SyncAndReplicate();
  EXPECT_EQ(SentRecords(), sent) << "nothing is sent twice";
}

TEST_F(CustomTypesTeamTest, SendsTheBaseStationOnlyTheNewestIfGroundIsLatest) {
  Start(/*without_types=*/0);
  for (int i = 1; i <= 20; ++i) Insert(kRover, kSoil, std::to_string(i), "hole " + std::to_string(i % 2));
  Insert(kLeader, kSoil, "the leader's own");
  // The first sync sends the base station only the records that the leader held when the sync began. The second sync
  // sends the records that the leader received during the first sync.
  SyncAndReplicate();
  SyncAndReplicate();
  EXPECT_EQ(PayloadsAt(kLeader, kSoil).size(), 21u);
  EXPECT_THAT(PayloadsAt(kBase, kSoil), testing::UnorderedElementsAre("19", "20", "the leader's own"));
  (void)SentRecords();
}

TEST_F(CustomTypesTeamTest, ALeaderThatDoesNotKnowTheTypeCarriesIt) {
  Start(/*without_types=*/kLeader);
  Insert(kRover, kSoil, "a", "x");
  Insert(kRover, kBeacon, "old", "b");
  SyncAndReplicate();
  EXPECT_THAT(PayloadsAt(kSurvivor, kBeacon), ElementsAre("old"));
  Insert(kRover, kBeacon, "new", "b");
  SyncAndReplicate();
  for (const AgentId agent : {kLeader, kSurvivor}) {
    EXPECT_THAT(PayloadsAt(agent, kSoil), ElementsAre("a")) << agent;
    EXPECT_THAT(PayloadsAt(agent, kBeacon), ElementsAre("new")) << agent;
  }
  const double sent = SentRecords();
  SyncAndReplicate();
  EXPECT_EQ(SentRecords(), sent);
}

TEST_F(CustomTypesTeamTest, NotifiesReadersOfNewRecords) {
  Start(/*without_types=*/0);
  // Discards the notifications that were published at the start.
  (void)team_.TakeMessages({kRover, "listener"});
  Insert(kRover, kSoil, "a");
  const auto reported = team_.TakeMessages({kRover, "listener"});
  ASSERT_EQ(reported.size(), 1u);
  EXPECT_THAT(reported[0].records_stored().data_types(), ElementsAre(kSoil));
}

TEST_F(CustomTypesTeamTest, ReportsATypeThatTheLeaderDefinesDifferentlyAndDoesNotSendIt) {
  other_name_at_ = kLeader;
  Start(/*without_types=*/0);
  Insert(kRover, kSoil, "dry");
  Insert(kRover, kBeacon, "here");
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(minutes(1));
  EXPECT_THAT(PayloadsAt(kLeader, kBeacon), ElementsAre("here"));
  EXPECT_TRUE(PayloadsAt(kLeader, kSoil).empty());
  const proto::ShareStatus status = ShareStatusOf(team_, kRover, actor_name::kSync);
  ASSERT_EQ(status.sessions_size(), 1);
  EXPECT_THAT(status.sessions(0).other_schema_types(), ElementsAre(kSoil));
  EXPECT_FALSE(status.sessions(0).is_open());
}

}  // namespace
}  // namespace moondb
