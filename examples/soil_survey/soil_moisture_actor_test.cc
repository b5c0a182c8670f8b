// Tests SoilMoistureActor in a simulated team, with real storage and sharing, a virtual clock, a radio, and crashes.
// Uses no sleeps and no sockets.
#include "soil_moisture_actor.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <memory>
#include <random>
#include <string>

#include "actors/sharing/sync_actor.h"
#include "actors/storage/storage_actor.h"
#include "model/control_message.h"
#include "model/custom_types.h"
#include "proto/control.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "runtime/team/team_config.h"

namespace soil_survey {
namespace {

using moondb::Address;
using moondb::AgentId;
using moondb::SendResult;
using moondb::proto::Message;
using moondb::simulation::Fault;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kLeader = 1;
constexpr AgentId kRover = 2;
constexpr moondb::DataType kSoilMoisture = 1007;

// A team of two agents. The sensor of each agent measures 0.1 times the agent's id.
class SoilMoistureActorTest : public testing::Test {
 protected:
  SoilMoistureActorTest() : file_(*moondb::ReadTeamFile(TEAM_FILE)) {
    for (const AgentId agent : {kLeader, kRover}) team_.AddAgent(agent);
    for (const AgentId agent : {kLeader, kRover}) {
      SpawnStandardActors(agent);
      SoilMoistureActor::Options soil;
      soil.data_type = kSoilMoisture;
      soil.sensor = [agent] { return 0.1 * agent; };
      team_.Spawn(agent, kActorName, [soil] { return std::make_unique<SoilMoistureActor>(soil); });
    }
  }

  void SpawnStandardActors(AgentId agent) {
    moondb::StorageActor::Options storage;
    storage.path = ":memory:";
    storage.self = agent;
    storage.team = file_.config;
    team_.Spawn(agent, "storage", [storage] { return std::make_unique<moondb::StorageActor>(storage); });
    moondb::SharingActor::Options sync;
    sync.self = agent;
    sync.team = file_.config;
    team_.Spawn(agent, "sync", [sync] { return std::make_unique<moondb::SyncActor>(sync); });
  }

  // Requests the averages from the actor of `agent`. Returns the number of measurements by agent.
  std::map<AgentId, std::uint64_t> MeasurementsKnownTo(AgentId agent) {
    Message question;
    question.mutable_custom()->PackFrom(AverageRequest());
    EXPECT_EQ(team_.Post(planner_, {agent, kActorName}, question), SendResult::kAccepted);
    const auto answer = team_.Expect(planner_, Message::kCustom, seconds(10));
    EXPECT_TRUE(answer.has_value());
    AverageReply reply;
    EXPECT_TRUE(answer && answer->custom().UnpackTo(&reply));
    std::map<AgentId, std::uint64_t> measurements;
    for (const AgentAverage& average : reply.averages()) {
      EXPECT_NEAR(average.water_ratio(), 0.1 * average.agent_id(), 1e-9);
      measurements[average.agent_id()] = average.measurements();
    }
    return measurements;
  }

  // Returns the number of records that `agent` stores. The request's sender has an address at the same agent, because
  // storage refuses requests of others.
  std::uint64_t RecordsStoredAt(AgentId agent) {
    const Address operator_at{agent, "operator"};  // The test receives messages to this address.
    moondb::proto::ControlRequest question;
    question.mutable_status();
    EXPECT_EQ(team_.Post(operator_at, {agent, "storage"}, moondb::MessageOf(question)), SendResult::kAccepted);
    const auto message = team_.Expect(operator_at, Message::kControlReply, seconds(10));
    EXPECT_TRUE(message.has_value());
    const auto answer = moondb::ControlReplyOf(*message);
    EXPECT_TRUE(answer.has_value());
    double count = 0;
    for (const auto& stored : answer->status().storage().counts()) count += stored.count();
    return static_cast<std::uint64_t>(count);
  }

  const moondb::TeamFile file_;
  const Address planner_{kLeader, "planner"};  // The test receives messages to this address.
  moondb::simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(SoilMoistureActorTest, MeasuresAtItsPaceAndKnowsItsAverage) {
  team_.AdvanceTime(minutes(35));
  EXPECT_EQ(MeasurementsKnownTo(kRover), (std::map<AgentId, std::uint64_t>{{kRover, 3}}));
}

TEST_F(SoilMoistureActorTest, KnowsWhatOthersMeasuredOnceItIsShared) {
  team_.AdvanceTime(minutes(25));
  EXPECT_EQ(MeasurementsKnownTo(kLeader), (std::map<AgentId, std::uint64_t>{{kLeader, 2}}));
  Message share;
  share.mutable_share_request()->set_kind(moondb::proto::SHARING_KIND_SYNC);
  EXPECT_EQ(team_.Post({kRover, "operator"}, {kRover, "sync"}, share), SendResult::kAccepted);
  team_.AdvanceTime(minutes(1));
  EXPECT_EQ(MeasurementsKnownTo(kLeader), (std::map<AgentId, std::uint64_t>{{kLeader, 2}, {kRover, 2}}));
}

TEST_F(SoilMoistureActorTest, IsUnreachableDuringAPartition) {
  Message question;
  question.mutable_custom()->PackFrom(AverageRequest());
  team_.Partition({{kLeader}, {kRover}});
  EXPECT_EQ(team_.Post(planner_, {kRover, kActorName}, question), SendResult::kUnreachable);
  team_.Heal();
  EXPECT_EQ(team_.Post(planner_, {kRover, kActorName}, question), SendResult::kAccepted);
  EXPECT_TRUE(team_.Expect(planner_, Message::kCustom, seconds(10)).has_value());
}

TEST_F(SoilMoistureActorTest, KnowsItsAverageAgainAfterACrash) {
  team_.AdvanceTime(minutes(15));
  team_.CrashActor({kRover, kActorName});
  EXPECT_EQ(MeasurementsKnownTo(kRover), (std::map<AgentId, std::uint64_t>{{kRover, 1}}));
  EXPECT_EQ(team_.restarts(kRover), 1u);
  team_.AdvanceTime(minutes(15));
  EXPECT_EQ(MeasurementsKnownTo(kRover), (std::map<AgentId, std::uint64_t>{{kRover, 2}}));
}

TEST_F(SoilMoistureActorTest, CountsStoredMeasurementsAfterACrashAtAnyPoint) {
  constexpr std::uint64_t kSeed = 7;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937_64 rng(kSeed);
  team_.SetFault([&rng](const Address& actor, const Message&) {
    if (actor != Address{kRover, kActorName} || rng() % 5 != 0) return Fault::kNone;
    constexpr std::array kFaults = {Fault::kBeforeHandler, Fault::kAtFirstSend, Fault::kAfterHandler};
    return kFaults[rng() % kFaults.size()];
  });
  team_.AdvanceTime(std::chrono::hours(20));
  team_.SetFault({});
  EXPECT_GT(team_.restarts(kRover), 50u);
  const std::uint64_t stored = RecordsStoredAt(kRover);
  EXPECT_GT(stored, 10u);
  EXPECT_EQ(MeasurementsKnownTo(kRover), (std::map<AgentId, std::uint64_t>{{kRover, stored}}));
}

TEST_F(SoilMoistureActorTest, ReadsAgainWhenStorageFailsWithTheQuestionInHand) {
  bool has_failed = false;
  team_.SetFault([&has_failed](const Address& actor, const Message& message) {
    if (actor != Address{kRover, "storage"} || !message.has_read_request() || has_failed) return Fault::kNone;
    has_failed = true;
    return Fault::kBeforeHandler;
  });
  team_.RunUntilIdle();
  ASSERT_TRUE(has_failed);
  team_.AdvanceTime(minutes(15));
  EXPECT_EQ(MeasurementsKnownTo(kRover).count(kRover), 1u);
}

TEST_F(SoilMoistureActorTest, SkipsInvalidPayloads) {
  Message insert;
  SoilMoisture impossible;
  impossible.set_water_ratio(7);
  for (const std::string& payload : {impossible.SerializeAsString(), std::string("\xFF not a payload")}) {
    moondb::proto::CustomRecord& custom = *insert.mutable_insert_request()->add_records()->mutable_custom();
    custom.set_data_type(kSoilMoisture);
    custom.set_payload(payload);
  }
  EXPECT_EQ(team_.Post({kRover, "robot"}, {kRover, "storage"}, insert), SendResult::kAccepted);
  team_.AdvanceTime(minutes(15));
  EXPECT_EQ(RecordsStoredAt(kRover), 3u);
  EXPECT_EQ(MeasurementsKnownTo(kRover), (std::map<AgentId, std::uint64_t>{{kRover, 1}}));
}

TEST_F(SoilMoistureActorTest, TheTeamFileDeclaresTheDataType) {
  EXPECT_EQ(moondb::DataTypeFromName(kDataTypeName, file_.config.custom_types()), kSoilMoisture);
}

}  // namespace
}  // namespace soil_survey
