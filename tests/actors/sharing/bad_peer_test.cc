// Tests that an agent's status shows the protocol violations of a team member, and that these violations fill neither
// the agent's store nor its memory.
#include <gtest/gtest.h>

#include "actors/sharing/codec.h"
#include "model/have_page.h"
#include "model/record_hash.h"
#include "model/wire_version.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;

constexpr AgentId kGood = 1;
constexpr AgentId kBad = 3;

// Agent 1 (kGood) runs the real sharing actors. Each test sends them chosen messages from agent 3 (kBad).
class BadPeerTest : public testing::Test {
 protected:
  BadPeerTest() {
    store_ = AddMemoryAgent(team_, kGood, config_);
    for (AgentId agent = 2; agent <= 4; ++agent) team_.AddAgent(agent);
    team_.AdvanceTime(seconds(1));
    (void)team_.TakeMessages({kBad, actor_name::kSync});
  }

  static proto::Message Hello(std::uint64_t session_id) {
    proto::Message message;
    proto::Hello& hello = *message.mutable_hello();
    hello.set_wire_version(kWireVersion);
    hello.set_team("test");
    hello.set_config_hash(1);
    hello.set_session_id(session_id);
    hello.set_kind(proto::SHARING_KIND_SYNC);
    return message;
  }

  static proto::Message Batch(std::uint64_t session_id, const std::string& content) {
    proto::RecordBatch records;
    proto::StoredRecord& record = *records.add_records();
    const RecordKey key{{kBad, 7, proto::POWER}, 1};
    *record.mutable_key() = ToProto(key);
    record.set_content(content);
    record.set_hash(HashRecord(key, "power"));
    const CodedBatch coded = EncodeBatch(records);
    proto::Message message;
    message.set_remaining(1);
    proto::Batch& batch = *message.mutable_batch();
    batch.set_session_id(session_id);
    batch.set_batch_number(1);
    batch.set_codec(coded.codec);
    batch.set_coded(coded.bytes);
    batch.set_record_count(1);
    return message;
  }

  void Say(const proto::Message& message, int times = 1) {
    for (int i = 0; i < times; ++i) (void)team_.Post({kBad, actor_name::kSync}, {kGood, actor_name::kSync}, message);
    team_.AdvanceTime(seconds(1));
  }

  int CountHeard(proto::Message::BodyCase body) {
    int count = 0;
    for (const proto::Message& message : team_.TakeMessages({kBad, actor_name::kSync}))
      count += message.body_case() == body;
    return count;
  }

  proto::ShareStatus Status() { return ShareStatusOf(team_, kGood, actor_name::kSync); }

  const proto::TeamConfig config_ = TestTeam(3);
  simulation::SimulatedTeam team_{/*seed=*/1};
  std::shared_ptr<MemoryStore> store_;
};

TEST_F(BadPeerTest, ShowsHellosOfAnotherTeam) {
  proto::Message hello = Hello(10);
  hello.mutable_hello()->set_team_id("fedcba9876543210");
  Say(hello, 100);
  EXPECT_EQ(Status().refused_hellos(), 100);
  EXPECT_EQ(CountHeard(proto::Message::kRefusal), 100);
}

TEST_F(BadPeerTest, ShowsAPeerWithAnotherConfiguration) {
  proto::Message hello = Hello(10);
  hello.mutable_hello()->set_config_hash(2);
  Say(hello);
  ASSERT_EQ(Status().other_config_agents_size(), 1);
  EXPECT_EQ(Status().other_config_agents(0), kBad);
  EXPECT_EQ(CountHeard(proto::Message::kHave), 1) << "heard nevertheless";
  Say(Hello(11));
  EXPECT_EQ(Status().other_config_agents_size(), 0);
}

TEST_F(BadPeerTest, ForgetsAnotherConfigurationOnceThePeerReconnects) {
  proto::Message hello = Hello(10);
  hello.mutable_hello()->set_config_hash(2);
  Say(hello);
  ASSERT_EQ(Status().other_config_agents_size(), 1);
  team_.SetLink(kBad, kGood, /*is_up=*/false, /*tell=*/true);
  team_.SetLink(kBad, kGood, /*is_up=*/true, /*tell=*/true);
  team_.RunUntilIdle();
  EXPECT_EQ(Status().other_config_agents_size(), 0) << "it may have nothing to send, and so says no Hello";
}

TEST_F(BadPeerTest, AnswersAFloodOfOneHelloOnce) {
  Say(Hello(10), 1000);
  EXPECT_EQ(CountHeard(proto::Message::kHave), 1);
}

TEST_F(BadPeerTest, ShowsDamagedBatches) {
  Say(Hello(10));
  proto::Message batch = Batch(10, "power");
  batch.mutable_batch()->mutable_coded()->resize(3);
  Say(batch);
  batch = Batch(10, "power");
  proto::StreamHave& reversed = *batch.mutable_batch()->add_dropped();
  reversed.set_origin_agent(kBad);
  reversed.add_dropped()->set_first(5);
  Say(batch);
  EXPECT_EQ(Status().damaged_messages(), 2);
  EXPECT_TRUE(store_->records().empty());
}

TEST_F(BadPeerTest, DecodesFewBatchesOfAPeerThatSendsDamagedOnes) {
  Say(Hello(10));
  proto::Message batch = Batch(10, "power");
  batch.mutable_batch()->mutable_coded()->resize(3);
  Say(batch, 10);
  EXPECT_EQ(Status().damaged_messages(), 2) << "three bytes earn some room";
  EXPECT_EQ(Status().dropped_messages(), 8);
  team_.AdvanceTime(std::chrono::minutes(2));
  Say(batch);
  EXPECT_EQ(Status().damaged_messages(), 3) << "it is heard again";
}

TEST_F(BadPeerTest, ShowsForgedRecords) {
  Say(Hello(10));
  Say(Batch(10, "another content under the key's hash"));
  EXPECT_EQ(Status().rejected_records(), 1);
  EXPECT_TRUE(store_->records().empty());
}

TEST_F(BadPeerTest, ShowsHowManyBatchesOfAFloodItDrops) {
  Say(Hello(10));
  Say(Batch(10, "power"), 100);
  EXPECT_EQ(Status().dropped_messages(), 84);
  EXPECT_EQ(store_->records().size(), 1u);
  EXPECT_EQ(CountHeard(proto::Message::kHave), 17) << "of the hello and of what was stored";
}

TEST_F(BadPeerTest, OpensOneSessionForAFloodOfShareRequests) {
  store_->Insert(kGood, proto::POWER, "own");
  Say(ShareOrder(proto::SHARING_KIND_SYNC), 1000);
  EXPECT_EQ(Status().sessions_size(), 1);
  EXPECT_EQ(CountHeard(proto::Message::kHello), 1);
}

TEST_F(BadPeerTest, ShowsAcknowledgmentsOfRecordsThatWereNeverSent) {
  store_->Insert(kGood, proto::POWER, "own");
  Say(ShareOrder(proto::SHARING_KIND_SYNC));
  proto::Message have;
  for (const proto::Message& message : team_.TakeMessages({kBad, actor_name::kSync})) {
    if (message.has_hello()) have.mutable_have()->set_session_id(message.hello().session_id());
  }
  have.mutable_have()->set_batch_number(UINT32_MAX);
  Say(have, 100);
  EXPECT_EQ(Status().sessions(0).refused_haves(), 0) << "it has not said what it has: the session still asks";
  have.mutable_have()->set_batch_number(0);
  have.mutable_have()->set_is_whole(true);
  Say(have);
  EXPECT_EQ(CountHeard(proto::Message::kBatch), 1);
  have.mutable_have()->set_is_whole(false);
  have.mutable_have()->set_batch_number(UINT32_MAX);
  Say(have, 100);
  EXPECT_EQ(Status().sessions(0).refused_haves(), 100);
  EXPECT_EQ(CountHeard(proto::Message::kBatch), 0);
  EXPECT_EQ(Status().sessions(0).acknowledged_records(), 0);
}

// Agent 3 answers each Hello with one page of a have-set. Each page announces a next page.
TEST_F(BadPeerTest, RefusesAHaveSetWithoutEnd) {
  store_->Insert(kGood, proto::POWER, "own");
  Say(ShareOrder(proto::SHARING_KIND_SYNC));
  int hellos = 0;
  for (int step = 0; step < 5000 && Status().sessions(0).refused_haves() == 0; ++step) {
    for (const proto::Message& message : team_.TakeMessages({kBad, actor_name::kSync})) {
      if (!message.has_hello()) continue;
      ++hellos;
      proto::Message page;
      proto::Have& have = *page.mutable_have();
      have.set_session_id(message.hello().session_id());
      have.set_is_whole(true);
      if (message.hello().has_have_from()) *have.mutable_have_from() = message.hello().have_from();
      const auto epoch = static_cast<std::uint64_t>(hellos);
      HaveSet one;
      one[{kBad, epoch, proto::POWER}].held.Add(1);
      *have.mutable_have() = ToProto(one);
      *have.mutable_have_next() = ToProto(RecordKey{{kBad, epoch + 1, proto::POWER}, 1});
      (void)team_.Post({kBad, actor_name::kSync}, {kGood, actor_name::kSync}, page);
    }
    team_.AdvanceTime(std::chrono::milliseconds(100));
  }
  EXPECT_EQ(Status().sessions(0).refused_haves(), 1);
  EXPECT_EQ(hellos, kHavePagesMax);
  team_.AdvanceTime(seconds(4));
  EXPECT_EQ(CountHeard(proto::Message::kHello), 0) << "it is asked again after the delay";
}

}  // namespace
}  // namespace moondb
