#include "actors/sharing/downlink_actor.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "actors/storage/storage_actor.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;

constexpr AgentId kSelf = 3;  // The base station.

// A DownlinkActor and the real StorageActor on the base station. The tests send requests as the gateway.
class DownlinkActorTest : public testing::Test {
 protected:
  DownlinkActorTest() {
    team_.AddAgent(kSelf);
    SpawnStorage();
    SpawnDownlink(team_);
  }

  void SpawnStorage() {
    StorageActor::Options storage;
    storage.path = ":memory:";
    storage.self = kSelf;
    storage.team = config_;
    team_.Spawn(kSelf, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
  }

  void SpawnDownlink(simulation::SimulatedTeam& team) {
    DownlinkActor::Options downlink;
    downlink.self = kSelf;
    downlink.team = config_;
    downlink.orders_max = 2;
    team.Spawn(kSelf, actor_name::kDownlink, [downlink] { return std::make_unique<DownlinkActor>(downlink); });
  }

  void InsertNodes(int count) {
    proto::Message message;
    for (int i = 0; i < count; ++i) {
      proto::Record& record = *message.mutable_insert_request()->add_records();
      record.set_timestamp_ns(next_index_);
      proto::PoseGraphNode& node = *record.mutable_pose_graph_node();
      node.mutable_node()->set_agent_id(kSelf);
      node.mutable_node()->set_index(static_cast<std::uint64_t>(next_index_++));
      node.mutable_map_from_node()->mutable_position_m()->set_x(std::uniform_real_distribution(0., 9.)(rng_));
      node.mutable_map_from_node()->mutable_orientation()->set_w(1);
    }
    const proto::Message reply = Ask(actor_name::kStorage, message);
    ASSERT_FALSE(IsError(reply.insert_reply().error())) << reply.insert_reply().error().text();
  }

  proto::Message Ask(const char* actor, const proto::Message& question) {
    EXPECT_EQ(team_.Post(requester_, {kSelf, actor}, question), SendResult::kAccepted);
    team_.RunUntilIdle();
    const std::vector<proto::Message> answers = team_.TakeMessages(requester_);
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? proto::Message() : answers.front();
  }

  proto::DownlinkReply Order(std::uint64_t bytes_max, std::uint32_t acknowledge = 0) {
    proto::Message message;
    message.mutable_downlink_request()->set_bytes_max(bytes_max);
    message.mutable_downlink_request()->set_acknowledge(acknowledge);
    return Ask(actor_name::kDownlink, message).downlink_reply();
  }

  std::string FileOf(std::uint32_t number) {
    proto::Message message;
    message.mutable_read_bundle_request()->set_number(number);
    return Ask(actor_name::kStorage, message).read_bundle_reply().part();
  }

  std::set<std::uint64_t> SeqsIn(std::uint32_t number) {
    std::set<std::uint64_t> seqs;
    const auto head = ReadBundle(FileOf(number), [&seqs](const proto::StoredRecord& record) -> Result<void> {
      seqs.insert(record.key().seq());
      return {};
    });
    EXPECT_TRUE(head) << ToString(head.error());
    return seqs;
  }

  const proto::TeamConfig config_ = TestTeam(2);
  simulation::SimulatedTeam team_{/*seed=*/1};
  const Address requester_{kSelf, actor_name::kGateway};
  std::int64_t next_index_ = 1;
  std::mt19937_64 rng_{1};  // Draws the nodes' positions, which do not compress.
};

TEST_F(DownlinkActorTest, PacksRequestedRecordsIntoBundlesWithoutRepeatingAny) {
  InsertNodes(300);
  std::set<std::uint64_t> seqs;
  double left = 300;
  for (std::uint32_t number = 1; left > 0; ++number) {
    const proto::DownlinkReply reply = Order(2000);
    ASSERT_FALSE(IsError(reply.error())) << reply.error().text();
    ASSERT_EQ(reply.made().number(), number);
    EXPECT_LE(reply.made().bytes(), 2000);
    EXPECT_EQ(reply.waiting_size(), static_cast<int>(number));
    const std::set<std::uint64_t> added = SeqsIn(number);
    EXPECT_EQ(static_cast<double>(added.size()), reply.made().record_count());
    EXPECT_EQ(HashOfBundle(FileOf(number)), reply.made().hash());
    const std::size_t before = seqs.size();
    seqs.insert(added.begin(), added.end());
    EXPECT_EQ(seqs.size(), before + added.size()) << "a record is in two bundles";
    left -= reply.made().record_count();
    EXPECT_EQ(reply.left_count(), left);
  }
  EXPECT_EQ(seqs.size(), 300u);
  EXPECT_GE(Order(0).waiting_size(), 2);
  const proto::DownlinkReply nothing = Order(2000);
  EXPECT_FALSE(IsError(nothing.error()));
  EXPECT_FALSE(nothing.has_made());
}

TEST_F(DownlinkActorTest, KeepsABundleUntilItIsAcknowledgedAndNeverPacksItsRecordsAgain) {
  InsertNodes(10);
  ASSERT_EQ(Order(8000).made().record_count(), 10);
  const std::string file = FileOf(1);
  InsertNodes(1);
  EXPECT_EQ(Order(0).left_count(), 1);
  EXPECT_EQ(FileOf(1), file);
  const proto::DownlinkReply acknowledged = Order(0, /*acknowledge=*/1);
  ASSERT_FALSE(IsError(acknowledged.error())) << acknowledged.error().text();
  EXPECT_EQ(acknowledged.waiting_size(), 0);
  EXPECT_EQ(acknowledged.left_count(), 1);
  EXPECT_EQ(FileOf(1), "");
  const proto::DownlinkReply next = Order(8000);
  EXPECT_EQ(next.made().number(), 2u);
  EXPECT_EQ(next.made().record_count(), 1);
}

TEST_F(DownlinkActorTest, LeavesOutRecordsThatTheGroundStationDoesNotRequest) {
  proto::Message message;
  proto::Record& record = *message.mutable_insert_request()->add_records();
  record.set_timestamp_ns(1);
  record.mutable_power()->set_battery_ratio(0.5);
  ASSERT_EQ(Ask(actor_name::kStorage, message).insert_reply().keys_size(), 1);
  EXPECT_EQ(Order(0).left_count(), 0);
  EXPECT_FALSE(Order(8000).has_made());
}

TEST_F(DownlinkActorTest, RefusesInvalidOrders) {
  EXPECT_EQ(Order(1000).error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(Order(17 * 1024 * 1024).error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(Order(2000, 1).error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(Order(0, 1).error().code(), proto::ERROR_CODE_NOT_FOUND);
}

TEST_F(DownlinkActorTest, LimitsTheNumberOfWaitingBundles) {
  for (int i = 0; i < kBundlesWaitingMax; ++i) {
    InsertNodes(1);
    ASSERT_TRUE(Order(2000).has_made());
  }
  InsertNodes(1);
  EXPECT_EQ(Order(2000).error().code(), proto::ERROR_CODE_REFUSED);
  ASSERT_FALSE(IsError(Order(0, 3).error()));
  EXPECT_TRUE(Order(2000).has_made());
}

TEST_F(DownlinkActorTest, CarriesOutOneOrderAtATimeAndQueuesAFew) {
  InsertNodes(300);
  proto::Message message;
  message.mutable_downlink_request()->set_bytes_max(1500);
  for (std::uint64_t id = 1; id <= 3; ++id) {
    message.set_request_id(id);
    ASSERT_EQ(team_.Post(requester_, {kSelf, actor_name::kDownlink}, message), SendResult::kAccepted);
  }
  team_.RunUntilIdle();
  std::set<std::uint32_t> numbers;
  int refused_count = 0;
  for (const proto::Message& answer : team_.TakeMessages(requester_)) {
    if (answer.downlink_reply().error().code() == proto::ERROR_CODE_FULL) {
      EXPECT_EQ(answer.request_id(), 3u);
      ++refused_count;
    } else {
      numbers.insert(answer.downlink_reply().made().number());
    }
  }
  EXPECT_EQ(refused_count, 1);
  EXPECT_EQ(numbers, (std::set<std::uint32_t>{1, 2}));
}

TEST_F(DownlinkActorTest, AnswersThoughStorageDoesNot) {
  // This team has no StorageActor, so storage never answers.
  simulation::SimulatedTeam team(/*seed=*/1);
  team.AddAgent(kSelf);
  SpawnDownlink(team);
  proto::Message message;
  message.mutable_downlink_request()->set_bytes_max(2000);
  ASSERT_EQ(team.Post(requester_, {kSelf, actor_name::kDownlink}, message), SendResult::kAccepted);
  team.AdvanceTime(minutes(2));
  const std::vector<proto::Message> answers = team.TakeMessages(requester_);
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].downlink_reply().error().code(), proto::ERROR_CODE_TIMED_OUT);
}

TEST_F(DownlinkActorTest, AcceptsNoOrderFromAnotherAgent) {
  proto::Message message;
  message.mutable_downlink_request()->set_acknowledge(1);
  team_.AddAgent(1);
  ASSERT_EQ(team_.Post({1, actor_name::kGateway}, {kSelf, actor_name::kDownlink}, message), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_TRUE(team_.TakeMessages({1, actor_name::kGateway}).empty());
}

}  // namespace
}  // namespace moondb
