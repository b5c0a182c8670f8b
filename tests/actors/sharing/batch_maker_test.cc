#include "actors/sharing/batch_maker.h"

#include <gtest/gtest.h>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

class BatchMakerTest : public SessionFixture {};

TEST_F(BatchMakerTest, FillsTheFieldsThatThePaperDefines) {
  const RecordKey first = source_.Insert(3, proto::POSE_GRAPH_NODE, Noise(2000));
  source_.Insert(3, proto::POSE_GRAPH_NODE, Noise(3900));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 2u);
  EXPECT_EQ(batches[0].ms_type(), proto::DATA);
  EXPECT_EQ(batches[0].agent_id(), 3u);
  EXPECT_EQ(batches[0].destination_id(), kDestination);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POSE_GRAPH_NODE));
  EXPECT_EQ(batches[0].record_id(), ToString(first));
  EXPECT_EQ(batches[0].remaining(), 1u);
  EXPECT_EQ(batches[1].remaining(), 0u);
}

TEST_F(BatchMakerTest, CountsRemainingDownToZero) {
  for (int i = 0; i < 500; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(90));
  Order();
  AnswerHello();
  std::uint64_t left = 500;
  for (const auto& message : RunToEnd()) {
    left -= message.batch().record_count();
    EXPECT_EQ(message.remaining(), left);
  }
  EXPECT_EQ(left, 0u);
}

TEST_F(BatchMakerTest, FillsMessagesWithCompressibleContent) {
  UseCodec(proto::CODEC_ZSTD);
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, std::string(90, 'x') + Noise(3));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  std::size_t bytes = 0;
  for (const auto& message : batches) bytes += message.batch().coded().size();
  EXPECT_GT(static_cast<double>(bytes) / static_cast<double>(batches.size()), 2500.0);
}

TEST_F(BatchMakerTest, SendsALargeRecordInFragments) {
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(100));
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100'000));
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100));
  Order();
  AnswerHello();
  std::size_t fragments = 0;
  std::uint64_t remaining = 3;
  while (!sent_.empty()) {
    std::size_t unacked = 0;
    for (const proto::Message& message : sent_) unacked += message.batch().ByteSizeLong();
    EXPECT_LE(unacked, 8 * 1024u);
    for (const proto::Message& message : TakeSent()) {
      fragments += message.batch().has_fragment() ? 1 : 0;
      EXPECT_LE(message.batch().coded().size(), 4096u);
      EXPECT_LE(message.remaining(), remaining);
      remaining = message.remaining();
      Acknowledge(message);
    }
  }
  EXPECT_EQ(fragments, 25u);
  EXPECT_EQ(remaining, 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().acknowledged_records(), 3);
  EXPECT_EQ(Status().remaining(), 0);
}

TEST_F(BatchMakerTest, AnOrderDuringTheLastRecordDelaysTheEnd) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(10'000));
  Order();
  AnswerHello();
  const auto first = TakeSent();
  ASSERT_EQ(first.size(), 2u) << "two pieces fit into the credit";
  Acknowledge(first[0]);
  Acknowledge(first[1]);
  EXPECT_TRUE(sent_.back().batch().has_fragment());
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100));
  Order();
  std::size_t fragments = first.size();
  for (const proto::Message& message : RunToEnd()) {
    fragments += message.batch().has_fragment() ? 1 : 0;
    EXPECT_EQ(message.remaining() == 0, destination_.records().size() == 2u);
  }
  EXPECT_EQ(fragments, 3u) << "nothing was cut again";
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, ResumesALargeRecordAfterALinkFailure) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100'000));
  Order();
  AnswerHello();
  std::size_t fragments = 0;
  for (; fragments < 10; ++fragments) {
    const proto::Message fragment = sent_.front();
    sent_.erase(sent_.begin());
    Acknowledge(fragment);
  }
  TakeSent();  // The messages in flight are lost.
  Take(session_.OnConnected(now_));
  AnswerHello();
  fragments += RunToEnd().size();
  EXPECT_EQ(fragments, 25u) << "what had arrived was not sent again";
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, ReportsDropsInSmallMessages) {
  for (int i = 0; i < 4000; ++i) {
    const RecordKey key = source_.Insert(kSelf, proto::OPTIMIZED_POSE, "p");
    if (i % 2 == 1) source_.Drop(key);
  }
  Order();
  AnswerHello();
  for (const auto& message : RunToEnd()) EXPECT_LE(message.batch().ByteSizeLong(), 4u * 1024 + 64);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, ReportsDropsOnlyWithTheLastRecords) {
  // The first 2,000 records compress well, the last 40 do not. BatchMaker therefore fetches more records from storage
  // than fit into one batch.
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, std::string(90, 'x'));
  for (int i = 0; i < 40; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(500));
  source_.Drop(source_.Insert(kSelf, proto::POWER, "old"));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_GT(batches.size(), 6u);
  for (const auto& message : batches) {
    if (message.remaining() > 0) {
      EXPECT_EQ(message.batch().dropped_size(), 0);
    }
  }
  EXPECT_EQ(destination_.have(), source_.have());
  Order();
  AnswerHello();
  // The destination already knows which records were dropped.
  for (const auto& batch : RunToEnd()) EXPECT_EQ(batch.batch().dropped_size(), 0);
}

TEST_F(BatchMakerTest, ReportsDropsWhenNoRecordIsMissing) {
  source_.Drop(source_.Insert(kSelf, proto::POWER, "old"));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].batch().record_count(), 0u);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, UsesTheCompactCodecByDefault) {
  OrderMaps(60);
  std::size_t batches = 0;
  for (const proto::Message& message : RunToEnd()) {
    EXPECT_EQ(message.batch().codec(), proto::CODEC_COMPACT);
    EXPECT_LE(message.batch().coded().size(), 4096u);
    ++batches;
  }
  EXPECT_LE(batches, 12u);
  EXPECT_EQ(destination_.records().size(), 60u);
  EXPECT_EQ(Status().codec(), proto::CODEC_COMPACT);
}

TEST_F(BatchMakerTest, ItsBatchesOfMapsDependOnEarlierOnes) {
  OrderMaps(60);
  const std::vector<proto::Message> batches = RunToEnd();
  ASSERT_GE(batches.size(), 3u);
  EXPECT_TRUE(IsReadByItself(batches.front()));
  for (std::size_t i = 1; i < batches.size(); ++i) EXPECT_FALSE(IsReadByItself(batches[i])) << i;
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(BatchMakerTest, ARunContinuesInTheNextOrder) {
  OrderMaps(20);
  RunToEnd();
  OrderMaps(4, 20);
  for (const proto::Message& message : RunToEnd()) EXPECT_FALSE(IsReadByItself(message));
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(BatchMakerTest, ARunRestartsIfTheDestinationForgotIt) {
  OrderMaps(20);
  RunToEnd();
  InsertMaps(4, 20);
  Order();
  runs_ = RunDecoders(1, {});
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

TEST_F(BatchMakerTest, ARunRestartsIfOneOfItsBatchesWasInFlight) {
  OrderMaps(60, 0, 2048);
  Acknowledge(sent_.front());
  ASSERT_GT(sent_.back().remaining(), 0u);
  sent_.clear();
  Take(session_.OnConnected(now_));
  AnswerHello();
  EXPECT_TRUE(IsReadByItself(sent_.front()));
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, CodesEachBatchIndependentlyForADestinationThatKeepsNoRuns) {
  are_runs_kept_ = false;
  OrderMaps(60);
  for (const proto::Message& message : RunToEnd()) EXPECT_TRUE(IsReadByItself(message));
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, AnOrderBeforeTheEndDoesNotRestartTheRun) {
  OrderMaps(20);
  ASSERT_GT(sent_.back().remaining(), 0u) << "the end waits for these";
  InsertMaps(4, 20);
  Order();
  const std::vector<proto::Message> batches = RunToEnd();
  for (std::size_t i = 1; i < batches.size(); ++i) EXPECT_FALSE(IsReadByItself(batches[i])) << i;
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

// Each batch of a run is coded with reference to earlier batches of the run. The destination loses its decoder, so it
// cannot read the remaining batches of the run.
TEST_F(BatchMakerTest, SendsNoMoreBatchesOfABrokenRun) {
  OrderMaps(60, 0, 2048);
  const proto::Message first = sent_.front();
  sent_.erase(sent_.begin());
  Acknowledge(first);
  runs_ = RunDecoders(1, {});
  runs_.TakePlace(kSelf, now_);
  for (const proto::Message& message : TakeSent()) Acknowledge(message);
  ASSERT_FALSE(sent_.empty());
  for (const proto::Message& message : RunToEnd()) EXPECT_TRUE(IsReadByItself(message));
}

TEST_F(BatchMakerTest, ALargeMapIsCodedAgainIfTheMapsThatItDependsOnAreMissing) {
  OrderMaps(20);
  RunToEnd();
  InsertMaps(1, 20);
  for (int i = 21; i < 23; ++i) InsertNoiseMap(i, 200);
  runs_ = RunDecoders(1, {});
  Order();
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

TEST_F(BatchMakerTest, ADamagedBatchEndsItsRun) {
  OrderMaps(60);
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  std::string damaged = sent[0].batch().coded();
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 1);
  EXPECT_FALSE(runs_.Decode(kSelf, sent[0].batch(), damaged, now_));
  for (std::size_t i = 1; i < sent.size(); ++i) Acknowledge(sent[i]);
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(BatchMakerTest, MapsSentInFragmentsArePartOfTheRun) {
  InsertNoiseMap(0, 300);
  OrderMaps(20);
  bool has_fragments = false;
  for (const proto::Message& message : RunToEnd()) has_fragments |= message.batch().has_fragment();
  EXPECT_TRUE(has_fragments);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(BatchMakerTest, UsesTheCodecOfItsOptions) {
  const proto::RecordBatch rows = RowBatch(300);
  for (const proto::Codec codec : {proto::CODEC_PLAIN, proto::CODEC_ZSTD}) {
    UseCodec(codec);
    for (const proto::StoredRecord& record : rows.records()) {
      source_.Insert(kSelf, proto::TEMPERATURE, record.content());
    }
    Order();
    AnswerHello();
    for (const proto::Message& message : RunToEnd()) EXPECT_EQ(message.batch().codec(), codec);
    EXPECT_EQ(Status().codec(), codec);
  }
  EXPECT_EQ(destination_.records().size(), 600u);
}

TEST_F(BatchMakerTest, ReportsTheBacklogByType) {
  for (int i = 0; i < 3; ++i) source_.Insert(kSelf, proto::POWER, Noise(1500));
  for (int i = 0; i < 9; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(1500));
  Order();
  AnswerHello();
  const proto::ShareSession status = Status();
  double left = 0;
  for (const proto::TypeBacklog& type : status.backlog()) left += type.records();
  ASSERT_EQ(status.backlog_size(), 1);  // All POWER records are in batches already.
  EXPECT_EQ(status.backlog(0).data_type(), static_cast<std::uint32_t>(proto::POSE_GRAPH_NODE));
  EXPECT_LT(left, 9);
  EXPECT_GT(left, 4);
  RunToEnd();
  EXPECT_TRUE(Status().backlog().empty());
}

TEST_F(BatchMakerTest, NumbersItsBatchesFromOneInEachSession) {
  BatchMaker maker(kDestination, proto::CODEC_ZSTD, {}, 1);
  maker.StartOver(77, /*is_any_in_flight=*/false);
  const proto::MissingReply nothing;
  EXPECT_TRUE(maker.Make(nothing, 4096, /*is_part_of_order=*/false)) << "the end is a batch without records";
  EXPECT_EQ(maker.Take().message.batch().batch_number(), 1u);
  EXPECT_EQ(maker.next_number(), 2u);
  EXPECT_TRUE(maker.has_reported_end());
  EXPECT_TRUE(maker.Make(nothing, 4096, /*is_part_of_order=*/false));
  EXPECT_FALSE(maker.ready()) << "it has reported the end";
  maker.PutOffEnd();
  EXPECT_FALSE(maker.has_reported_end());
  EXPECT_TRUE(maker.Make(nothing, 4096, /*is_part_of_order=*/false));
  EXPECT_TRUE(maker.ready());
  maker.StartOver(78, /*is_any_in_flight=*/false);
  EXPECT_FALSE(maker.ready());
  EXPECT_EQ(maker.next_number(), 1u);
  EXPECT_TRUE(maker.Make(nothing, 4096, /*is_part_of_order=*/true)) << "the end of a part of an order is not reported";
  EXPECT_FALSE(maker.ready());
}

}  // namespace
}  // namespace moondb
