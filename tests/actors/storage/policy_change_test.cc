// Tests agents whose team files differ because an operator changes a policy agent by agent.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "actors/storage/record_store.h"
#include "actors/storage/record_validator.h"
#include "model/have_set.h"
#include "model/record_hash.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;

constexpr AgentId kRover = 3;
constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;

class PolicyChangeTest : public testing::Test {
 protected:
  // Opens the store of `agent`. The agent's team file has this policy for temperatures.
  std::unique_ptr<RecordStore> Start(AgentId agent, proto::Policy policy) {
    RecordStore::Options options =
        StoreOptionsOf(agent, folder_.File(std::to_string(agent) + ".sqlite"), /*seed=*/++starts_);
    options.policies[proto::TEMPERATURE] = policy;
    return OpenStore(options);
  }

  void Restart(std::unique_ptr<RecordStore>& store, AgentId agent, proto::Policy policy) {
    store.reset();
    store = Start(agent, policy);
  }

  static void Insert(RecordStore& store, const std::vector<double>& celsius) {
    for (const double value : celsius) InsertOne(store, TemperatureRecord(value));
  }

  // Sends `to` all records of `from` that `to` lacks, and reports which records `from` has dropped. A store under
  // policy `all` ignores such reports.
  static void TransferAll(RecordStore& from, RecordStore& to) {
    proto::MissingRequest request;
    *request.mutable_destination_have() = to.GetHave().have();
    const Result<proto::MissingReply> missing = from.GetMissing(request);
    ASSERT_TRUE(missing);
    ASSERT_EQ(missing->remaining(), 0u) << "one page is enough here";
    proto::StoreRequest brought;
    *brought.mutable_records() = missing->records();
    *brought.mutable_dropped() = missing->dropped();
    const proto::StoreReply reply = to.Store(brought).reply;
    EXPECT_FALSE(IsError(reply.error()));
    EXPECT_EQ(reply.rejected_count(), 0u) << "different team files are no fault of the sender";
  }

  static std::vector<double> TemperaturesOf(RecordStore& store) {
    std::vector<double> temperatures;
    for (const proto::StoredRecord& stored : Contents(store)) {
      proto::Record record;
      EXPECT_TRUE(record.ParseFromString(stored.content()));
      if (record.has_temperature()) temperatures.push_back(record.temperature().celsius());
    }
    return temperatures;
  }

  const TemporaryFolder folder_;
  std::uint64_t starts_ = 0;
};

TEST_F(PolicyChangeTest, AgentsThatStillKeepOnlyTheLatestLoseNoRecordOfARoverThatKeepsAll) {
  auto rover = Start(kRover, proto::POLICY_LATEST);
  Insert(*rover, {-20, -21});
  Restart(rover, kRover, proto::POLICY_ALL);
  Insert(*rover, {-22, -23, -24});
  auto leader = Start(kLeader, proto::POLICY_LATEST);
  auto survivor = Start(kSurvivor, proto::POLICY_LATEST);
  TransferAll(*rover, *leader);
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-21, -22, -23, -24));
  TransferAll(*leader, *survivor);
  EXPECT_THAT(TemperaturesOf(*survivor), ElementsAre(-21, -22, -23, -24)) << "over a leader that does not know";
  Restart(leader, kLeader, proto::POLICY_ALL);
  Restart(survivor, kSurvivor, proto::POLICY_ALL);
  Insert(*rover, {-25});
  TransferAll(*rover, *leader);
  TransferAll(*leader, *survivor);
  EXPECT_THAT(TemperaturesOf(*survivor), ElementsAre(-21, -22, -23, -24, -25));
}

TEST_F(PolicyChangeTest, TheLastStateBeforeThePolicyChangeStaysHoweverLateItArrives) {
  auto rover = Start(kRover, proto::POLICY_LATEST);
  Insert(*rover, {-20});
  const std::vector<proto::StoredRecord> state = Contents(*rover);
  Restart(rover, kRover, proto::POLICY_ALL);
  Insert(*rover, {-21});
  const std::vector<proto::StoredRecord> all = Contents(*rover);
  ASSERT_EQ(all.size(), 2u) << "its own policy supersedes nothing";
  auto leader = Start(kLeader, proto::POLICY_LATEST);
  EXPECT_EQ(StoreOne(*leader, all[1]).stored_count(), 1u);
  EXPECT_EQ(StoreOne(*leader, state[0]).stored_count(), 1u);
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-21, -20));
}

TEST_F(PolicyChangeTest, AnAgentThatKeepsAllKeepsStatesThatTheOriginDropped) {
  auto rover = Start(kRover, proto::POLICY_LATEST);
  auto leader = Start(kLeader, proto::POLICY_ALL);
  for (const double celsius : {-20.0, -21.0}) {
    Insert(*rover, {celsius});
    TransferAll(*rover, *leader);
  }
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-20, -21));
  EXPECT_THAT(TemperaturesOf(*rover), ElementsAre(-21));
}

TEST_F(PolicyChangeTest, AStateSupersedesNoRecordThatItsOriginStoredUnderPolicyAll) {
  auto rover = Start(kRover, proto::POLICY_ALL);
  Insert(*rover, {-20, -21});
  const std::vector<proto::StoredRecord> all = Contents(*rover);
  Restart(rover, kRover, proto::POLICY_LATEST);
  Insert(*rover, {-22, -23});
  EXPECT_THAT(TemperaturesOf(*rover), ElementsAre(-20, -21, -23));
  auto leader = Start(kLeader, proto::POLICY_LATEST);
  TransferAll(*rover, *leader);
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-20, -21, -23));
  auto survivor = Start(kSurvivor, proto::POLICY_LATEST);
  StoreOne(*survivor, Contents(*rover)[2]);
  for (const proto::StoredRecord& record : all) EXPECT_EQ(StoreOne(*survivor, record).stored_count(), 1u);
  EXPECT_THAT(TemperaturesOf(*survivor), ElementsAre(-23, -20, -21)) << "those that come late stay too";
}

// An agent that lost its disk stores its next records in an epoch that may be lower than the epochs of the lost disk.
TEST_F(PolicyChangeTest, ARecordOfALowerEpochThanAStateStaysWhateverAPeerDropped) {
  constexpr std::uint64_t kStatesEpoch = 5;
  const StreamKey before{kRover, kStatesEpoch, proto::TEMPERATURE};
  const StreamKey after{kRover, kStatesEpoch - 1, proto::TEMPERATURE};
  auto leader = Start(kLeader, proto::POLICY_LATEST);
  StoreOne(*leader, Packed(RecordKey{before, 1}, TemperatureRecord(-20)));
  proto::StoredRecord kept = Packed(RecordKey{after, 1}, TemperatureRecord(-21));
  kept.set_content(SerializeRecord(TemperatureRecord(-21)));
  kept.set_hash(HashRecord(RecordKey{after, 1}, kept.content()));
  EXPECT_EQ(StoreOne(*leader, kept).stored_count(), 1u);
  HaveSet dropped;
  dropped[after].dropped.Add(1);
  proto::StoreRequest request;
  *request.mutable_dropped() = ToProto(dropped).streams();
  EXPECT_FALSE(IsError(leader->Store(request).reply.error()));
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-20, -21));
}

TEST_F(PolicyChangeTest, AClientCannotMarkARecordAsAState) {
  auto rover = Start(kRover, proto::POLICY_ALL);
  Insert(*rover, {-20});
  proto::Record state = TemperatureRecord(-21);
  state.set_is_state(true);
  InsertOne(*rover, state);
  auto leader = Start(kLeader, proto::POLICY_LATEST);
  TransferAll(*rover, *leader);
  EXPECT_THAT(TemperaturesOf(*leader), ElementsAre(-20, -21));
}

TEST_F(PolicyChangeTest, ARobotMayInsertARecordAgainUnderAnotherPolicy) {
  auto options = StoreOptionsOf(kRover, folder_.File("repeat.sqlite"));
  const proto::RecordKey first = InsertOne(*OpenStore(options), NodeRecord(kRover, 7));
  options.policies[proto::POSE_GRAPH_NODE] = proto::POLICY_LATEST;
  ++options.seed;
  EXPECT_EQ(InsertOne(*OpenStore(options), NodeRecord(kRover, 7)).DebugString(), first.DebugString());
}

}  // namespace
}  // namespace moondb
