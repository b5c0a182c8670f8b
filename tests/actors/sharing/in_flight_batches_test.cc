#include "actors/sharing/in_flight_batches.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class InFlightBatchesTest : public SessionFixture {};

TEST_F(InFlightBatchesTest, KeepsMessagesSmallAndUnacknowledgedBytesWithinTheCredit) {
  for (int i = 0; i < 500; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  std::vector<proto::Message> in_flight;
  std::size_t most_in_flight = 0;
  while (session_.is_open()) {
    for (proto::Message& message : TakeSent()) {
      EXPECT_LE(message.batch().coded().size(), 4096u);
      in_flight.push_back(std::move(message));
    }
    std::size_t bytes = 0;
    for (const auto& message : in_flight) bytes += message.batch().ByteSizeLong();
    EXPECT_LE(bytes, 8u * 1024);
    most_in_flight = std::max(most_in_flight, in_flight.size());
    ASSERT_FALSE(in_flight.empty());
    Acknowledge(in_flight.front());
    in_flight.erase(in_flight.begin());
  }
  // The next batch is in flight while an acknowledgment returns, so the radio is never idle.
  EXPECT_GE(most_in_flight, 2u);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(InFlightBatchesTest, SendsOneMessageAtATimeWithoutCredit) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello(/*credit=*/0);
  while (session_.is_open()) {
    const auto sent = TakeSent();
    ASSERT_EQ(sent.size(), 1u);
    Acknowledge(sent[0]);
  }
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(InFlightBatchesTest, ObeysTheLatestCredit) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u);
  // The destination lowers its credit, because other senders have begun to send.
  credit_ = 2048;
  for (const proto::Message& batch : sent) Acknowledge(batch);
  for (int i = 0; i < 4; ++i) {
    sent = TakeSent();
    ASSERT_EQ(sent.size(), 1u);
    EXPECT_LE(sent[0].batch().coded().size(), i == 0 ? 4096u : 2048u) << "the first was ready before";
    if (i == 3) credit_ = 8192;
    Acknowledge(sent[0]);
  }
  EXPECT_EQ(TakeSent().size(), 2u);
  sent_ = {};
}

TEST_F(InFlightBatchesTest, SendsALostBatchAgainBeforeTheRestEnds) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  bool is_first = true;
  while (session_.is_open()) {
    const auto sent = TakeSent();
    ASSERT_FALSE(sent.empty());
    for (const auto& message : sent) {
      if (!std::exchange(is_first, false)) Acknowledge(message);
    }
  }
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

// The batch with `remaining` 0 reports that the destination has all records. The session must not send this batch while
// an earlier batch is unacknowledged.
TEST_F(InFlightBatchesTest, SendsTheEndOnlyWhenAllEarlierBatchesAreAcknowledged) {
  for (int i = 0; i < 3; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(3000));
  Order();
  AnswerHello();
  std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u) << "the last one waits for these";
  EXPECT_EQ(sent[1].remaining(), 1u);
  Acknowledge(sent[1]);
  EXPECT_TRUE(TakeSent().empty()) << "the first one is still open";
  const proto::Have late = Store(sent[0]);
  Take(session_.OnHave(late, now_));
  sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].remaining(), 0u);
  EXPECT_EQ(destination_.records().size() + sent[0].batch().record_count(), 3u);
}

TEST_F(InFlightBatchesTest, GivesUpALostBatchBeforeItSendsTheEnd) {
  for (int i = 0; i < 4; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(3000));
  Order();
  AnswerHello();
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u);
  Acknowledge(sent[1]);  // The first batch is lost.
  std::uint64_t covered = 1;
  for (const proto::Message& message : RunToEnd()) {
    covered += message.batch().record_count();
    EXPECT_EQ(message.remaining() == 0, covered == 4u);
  }
  EXPECT_EQ(destination_.records().size(), 4u);
  EXPECT_FALSE(session_.is_open());
}

TEST_F(InFlightBatchesTest, DoesNotResendRecordsThatTheDestinationRejects) {
  destination_.Reject(proto::POWER);
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/0, {kSelf, 7}));
  AnswerHello();
  EXPECT_EQ(RunToEnd().size(), 1u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().acknowledged_records(), 1);
  ASSERT_EQ(Status().orders_size(), 1);
  EXPECT_EQ(Status().orders(0).completed(), 0u) << "a client that waits must not read that all is acknowledged";
  EXPECT_EQ(Status().orders(0).closed(), 7u);
  EXPECT_EQ(Status().last_error(), "the destination did not accept 1 records");
}

TEST_F(InFlightBatchesTest, RefusesAnAcknowledgmentOfRecordsThatWereNeverSent) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  proto::Have have;
  have.set_session_id(sent.front().batch().session_id());
  for (const std::uint32_t number : {0u, sent.back().batch().batch_number() + 1, UINT32_MAX}) {
    have.set_batch_number(number);
    Take(session_.OnHave(have, now_));
  }
  EXPECT_TRUE(TakeSent().empty()) << "nothing is sent again";
  EXPECT_EQ(Status().resends(), 0);
  EXPECT_EQ(Status().acknowledged_records(), 0);
  EXPECT_EQ(Status().refused_haves(), 3);
  sent_ = sent;
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(InFlightBatchesTest, BoundsTheHaveSetThatItKeepsOfADestination) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const proto::Batch first = TakeSent().front().batch();
  proto::Have have;
  have.set_session_id(first.session_id());
  have.set_batch_number(first.batch_number());
  for (std::uint64_t epoch = 0; epoch < 30; ++epoch) {
    have.clear_have();
    for (AgentId origin = 1; origin <= 4096; ++origin) {
      proto::StreamHave& stream = *have.mutable_have()->add_streams();
      stream.set_origin_agent(1 + origin % kAgentIdMax);
      stream.set_epoch(epoch << 32 | origin);
      stream.set_data_type(proto::POWER);
    }
    Take(session_.OnHave(have, now_));
    TakeSent();
  }
  EXPECT_GE(Status().refused_haves(), 14);
  Take(session_.OnPeerHaveRequest(UINT64_MAX));
  EXPECT_GT(peer_haves_.back().acknowledged().streams_size(), kHaveStreamsMax / 2);
  for (const proto::PeerHave& reported : std::exchange(peer_haves_, {})) {
    EXPECT_LE(reported.acknowledged().streams_size(), kHaveStreamsMax);
  }
}

TEST_F(InFlightBatchesTest, DetectsALostBatchAtASlowRate) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(125, now_);
  Order();
  AnswerHello();
  TakeSent();  // The batches are lost.
  Advance(seconds(10));
  EXPECT_TRUE(TakeSent().back().has_hello());
}

TEST_F(InFlightBatchesTest, AnAcknowledgmentAfterGivingUpCounts) {
  OrderMaps(60);
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  // The second batch of the run arrives before the first batch. The destination cannot decode the second batch alone,
  // and requests a new run.
  const proto::Have stored = Store(sent[1]);
  EXPECT_TRUE(stored.needs_new_run());
  Take(session_.OnHave(stored, now_));
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (i != 1) Acknowledge(sent[i]);
  }
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(InFlightBatchesTest, SendsALostBatchOfARunAgainWithoutWaiting) {
  for (std::size_t lost = 0; lost < 4; ++lost) {
    SCOPED_TRACE(lost);
    source_ = MemoryStore();
    destination_ = MemoryStore();
    runs_ = RunDecoders(1, {});
    session_ = SharingSession(Options(), proto::SHARING_KIND_SYNC, kDestination, 1000);
    OrderMaps(60);
    std::size_t number = 0;
    while (!sent_.empty()) {
      for (const proto::Message& message : TakeSent()) {
        if (number++ != lost) Acknowledge(message);
      }
    }
    EXPECT_EQ(destination_.have(), source_.have());
    EXPECT_FALSE(session_.is_open());
    EXPECT_GE(Status().resends(), 1);
    EXPECT_LE(Status().resends(), 8 * 1024 / 1500) << "the bytes in flight";
  }
}

BatchContents ContentsOf(std::uint64_t first, std::uint64_t last, std::size_t bytes) {
  BatchContents batch;
  for (std::uint64_t seq = first; seq <= last; ++seq) batch.keys.push_back({{kSelf, 7, proto::POWER}, seq});
  batch.bytes = bytes;
  return batch;
}

HaveSet HaveOf(std::uint64_t first, std::uint64_t last) {
  HaveSet have;
  have[{kSelf, 7, proto::POWER}].held.Add(IntervalSet::Interval{first, last});
  return have;
}

TEST_F(InFlightBatchesTest, CountsInFlightRecordsAsCoveredUntilTheyAreGivenUp) {
  InFlightBatches in_flight;
  in_flight.SetHave(HaveOf(1, 2));
  in_flight.Add(1, ContentsOf(3, 4, 100));
  in_flight.Add(2, ContentsOf(5, 6, 100));
  EXPECT_EQ(in_flight.ExpectedHave({}), HaveOf(1, 6));
  EXPECT_EQ(in_flight.ExpectedHave(HaveOf(7, 9)), HaveOf(1, 9));
  EXPECT_EQ(in_flight.GiveUpBefore(2), 0u) << "the very next one may overtake it";
  EXPECT_EQ(in_flight.GiveUpBefore(4), 2u);
  EXPECT_EQ(in_flight.ExpectedHave({}), HaveOf(1, 2));
  EXPECT_EQ(in_flight.unacked_bytes(), 0u);
}

TEST_F(InFlightBatchesTest, AcknowledgesABatchByItsNumberAndOtherBatchesByTheirRecords) {
  InFlightBatches in_flight;
  in_flight.SetCredit(250);
  in_flight.Add(1, ContentsOf(1, 2, 100));
  in_flight.Add(2, ContentsOf(3, 4, 100));
  in_flight.Add(3, ContentsOf(5, 6, 40));
  EXPECT_FALSE(in_flight.HasRoomFor(20));
  in_flight.Join(HaveOf(1, 3));
  const InFlightBatches::Acknowledged acknowledged = in_flight.Acknowledge(2);
  EXPECT_EQ(acknowledged.batches, 2u);
  EXPECT_EQ(acknowledged.records, 3u);
  EXPECT_EQ(acknowledged.bytes, 200u);
  EXPECT_EQ(in_flight.RecordCount(), 2u);
  EXPECT_EQ(in_flight.RefusedCount(), 1u);
  EXPECT_TRUE(in_flight.HasRoomFor(20));
  EXPECT_EQ(in_flight.ExpectedHave({}), HaveOf(1, 6)) << "what it did not take is not sent again";
  in_flight.Clear();
  EXPECT_EQ(in_flight.ExpectedHave({}), HaveOf(1, 3)) << "but after a new start";
}

TEST_F(InFlightBatchesTest, GivesUpARunOnlyForABatchThatDependsOnOthers) {
  InFlightBatches in_flight;
  BatchContents leaning = ContentsOf(1, 1, 10);
  leaning.run = 5;
  leaning.leans_on_others = true;
  in_flight.Add(1, ContentsOf(2, 2, 10));
  in_flight.Add(2, leaning);
  EXPECT_FALSE(in_flight.GiveUpBroken(1));
  EXPECT_FALSE(in_flight.GiveUpBroken(3));
  EXPECT_EQ(in_flight.GiveUpBroken(2), 5u);
  EXPECT_FALSE(in_flight.GiveUpBroken(2)) << "it is given up";
}

}  // namespace
}  // namespace moondb
