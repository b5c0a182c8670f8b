#include "runtime/record_writer.h"

#include <gmock/gmock.h>

#include <memory>

#include "runtime/simulation/simulated_team.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using simulation::SimulatedTeam;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

std::vector<proto::Record> Records(int count) {
  std::vector<proto::Record> records;
  for (int i = 0; i < count; ++i) records.emplace_back().mutable_temperature()->set_celsius(i);
  return records;
}

// The test answers in storage's place.
class RecordWriterTest : public testing::Test {
 protected:
  static constexpr AgentId kSelf = 1;
  static inline const Address kStorage{kSelf, actor_name::kStorage};
  static inline const Address kWriter{kSelf, "writer"};

  RecordWriterTest() {
    team_.AddAgent(kSelf);
    team_.Spawn(kSelf, kWriter.actor, OnEachMessage([this](Context& context, const proto::Message& message) {
                  if (message.has_custom()) {
                    if (message.custom().value() == "stop") return writer_.Stop(context);
                    writer_.Write(context, Records(std::stoi(message.custom().value())));
                  } else if (!writer_.OnMessage(context, message)) {
                    ++others_;
                  }
                }));
  }

  void Order(const std::string& order) {
    proto::Message message;
    message.mutable_custom()->set_value(order);
    Post({kSelf, "test"}, std::move(message));
  }
  void Post(const Address& from, proto::Message message) {
    ASSERT_EQ(team_.Post(from, kWriter, std::move(message)), SendResult::kAccepted);
    team_.RunUntilIdle();
  }
  // Returns the numbers of records in the inserts since the last call. Keeps the id of the last one.
  std::vector<int> TakeInserts() {
    std::vector<int> counts;
    for (const proto::Message& message : team_.TakeMessages(kStorage)) {
      counts.push_back(message.insert_request().records_size());
      last_id_ = message.request_id();
    }
    return counts;
  }
  void Answer(int keys, const Address& from = kStorage, std::uint64_t id_offset = 0) {
    proto::Message reply;
    reply.set_request_id(last_id_ + id_offset);
    for (int i = 0; i < keys; ++i) reply.mutable_insert_reply()->add_keys();
    reply.mutable_insert_reply();
    Post(from, std::move(reply));
  }

  RecordWriter writer_{{.chunk_records_max = 3, .answer_timeout = 30s}};
  std::size_t others_ = 0;
  std::uint64_t last_id_ = 0;
  SimulatedTeam team_{/*seed=*/1};
};

TEST_F(RecordWriterTest, WritesChunkByChunk) {
  Order("7");
  EXPECT_THAT(TakeInserts(), ElementsAre(3));
  Answer(3);
  EXPECT_THAT(TakeInserts(), ElementsAre(3));
  EXPECT_TRUE(writer_.is_writing());
  Answer(3);
  EXPECT_THAT(TakeInserts(), ElementsAre(1));
  Answer(1);
  EXPECT_FALSE(writer_.is_writing());
  EXPECT_TRUE(writer_.result());
  EXPECT_EQ(writer_.stored_count(), 7u);
  EXPECT_EQ(others_, 0u);
}

TEST_F(RecordWriterTest, NothingToWriteIsWrittenAtOnce) {
  Order("0");
  EXPECT_FALSE(writer_.is_writing());
  EXPECT_TRUE(writer_.result());
  EXPECT_THAT(TakeInserts(), IsEmpty());
}

TEST_F(RecordWriterTest, OnlyTheAnswerOfStorageToTheLastChunkCounts) {
  Order("2");
  EXPECT_THAT(TakeInserts(), SizeIs(1));
  Answer(2, {kSelf, "other"});
  Answer(2, kStorage, /*id_offset=*/5);
  EXPECT_TRUE(writer_.is_writing());
  EXPECT_EQ(others_, 2u);
  Answer(2);
  EXPECT_FALSE(writer_.is_writing());
}

TEST_F(RecordWriterTest, AnErrorOfStorageEndsTheWriting) {
  Order("5");
  EXPECT_THAT(TakeInserts(), SizeIs(1));
  proto::Message reply;
  reply.set_request_id(last_id_);
  *reply.mutable_insert_reply()->mutable_error() = ToProto(Error{ErrorCode::kFull, "the disk is full", {}});
  Post(kStorage, std::move(reply));
  EXPECT_FALSE(writer_.is_writing());
  ASSERT_FALSE(writer_.result());
  EXPECT_EQ(writer_.result().error().code, ErrorCode::kFull);
  EXPECT_THAT(TakeInserts(), IsEmpty());
}

TEST_F(RecordWriterTest, AStorageThatDoesNotAnswerEndsTheWriting) {
  Order("2");
  team_.AdvanceTime(29s);
  EXPECT_TRUE(writer_.is_writing());
  team_.AdvanceTime(2s);
  EXPECT_FALSE(writer_.is_writing());
  ASSERT_FALSE(writer_.result());
  EXPECT_EQ(writer_.result().error().code, ErrorCode::kTimedOut);
  EXPECT_THAT(TakeInserts(), SizeIs(1));
  Answer(2);  // Too late.
  EXPECT_EQ(others_, 1u);
  Order("1");
  EXPECT_THAT(TakeInserts(), ElementsAre(1));
  Answer(1);
  EXPECT_TRUE(writer_.result());
}

TEST_F(RecordWriterTest, AStoppedWritingIgnoresItsAnswer) {
  Order("4");
  EXPECT_THAT(TakeInserts(), SizeIs(1));
  Order("stop");
  EXPECT_FALSE(writer_.is_writing());
  Answer(3);
  EXPECT_THAT(TakeInserts(), IsEmpty());
  team_.AdvanceTime(60s);
  EXPECT_FALSE(writer_.is_writing());
}

}  // namespace
}  // namespace moondb
