#include "actors/sharing/sharing_session.h"

#include <gtest/gtest.h>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class SharingSessionTest : public SessionFixture {};

TEST_F(SharingSessionTest, IsSilentUntilOrdered) {
  EXPECT_FALSE(session_.is_open());
  EXPECT_FALSE(session_.deadline());
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, AsksForTheHaveSetBeforeAnythingIsSent) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_TRUE(sent[0].has_hello());
  EXPECT_EQ(sent[0].hello().kind(), proto::SHARING_KIND_SYNC);
}

TEST_F(SharingSessionTest, ReportsThatNothingIsMissingAndCompletes) {
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].remaining(), 0u);
  EXPECT_EQ(batches[0].batch().record_count(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_TRUE(peer_haves_.back().is_session_closed());
}

TEST_F(SharingSessionTest, SendsOnlyMissingRecords) {
  for (int i = 0; i < 300; ++i) {
    const RecordKey key = source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
    if (i % 3 == 0) destination_.Insert(kSelf, proto::POSE_GRAPH_NODE, source_.records().at(key));
  }
  // The destination holds records with seqs 1 to 100, and lacks the other 200 records.
  for (const auto& [key, content] : destination_.records()) ASSERT_LE(key.seq, 100u);
  Order();
  AnswerHello();
  std::uint32_t count = 0;
  for (const auto& message : RunToEnd()) count += message.batch().record_count();
  EXPECT_EQ(count, 200u);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 200);
  EXPECT_EQ(Status().acknowledged_records(), 200);
  EXPECT_EQ(Status().remaining(), 0);
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(SharingSessionTest, ResendsUntilAcknowledgedWithAGrowingDelay) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  std::vector<double> hellos_s;
  for (int step = 0; step < 1400; ++step) {
    for (const auto& message : TakeSent()) {
      ASSERT_TRUE(message.has_hello());
      hellos_s.push_back(std::chrono::duration<double>(now_.time_since_epoch()).count());
    }
    Advance(std::chrono::milliseconds(100));
  }
  const std::vector<double> expected_s = {0, 5, 15, 35, 65, 95, 125};
  ASSERT_EQ(hellos_s.size(), expected_s.size());
  for (std::size_t i = 0; i < expected_s.size(); ++i) EXPECT_NEAR(hellos_s[i], expected_s[i], 0.15);
  EXPECT_EQ(Status().resends(), 6);
  Take(session_.OnConnected(now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  Advance(seconds(1000));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, StartsOverFromTheHaveSetWhenAnAcknowledgmentIsLost) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  Store(sent[0]);  // The destination stores the batch, but its acknowledgment is lost.
  Advance(seconds(6));
  AnswerHello();
  for (const auto& batch : RunToEnd()) EXPECT_EQ(batch.batch().record_count(), 0u);
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(Status().sent_records(), 1);
}

TEST_F(SharingSessionTest, StartsOverAtOnceWhenTheDestinationIsReachedAgain) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  const std::uint64_t first = TakeHello();
  Advance(seconds(1));
  Take(session_.OnConnected(now_));
  const std::uint64_t second = TakeHello();
  EXPECT_NE(first, second);
  Take(session_.OnConnected(now_));
  AnswerHello();
  RunToEnd();
  Take(session_.OnConnected(now_));  // Does nothing, because no order is open.
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, IgnoresMessagesOfAnEarlierSession) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  proto::Have old;
  old.set_session_id(TakeHello());
  old.set_is_whole(true);
  Advance(seconds(6));
  Take(session_.OnHave(old, now_));
  for (const auto& message : TakeSent()) EXPECT_TRUE(message.has_hello());
  proto::Refusal refusal;
  refusal.set_session_id(old.session_id());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_TRUE(session_.is_open());
}

TEST_F(SharingSessionTest, EndsWithTheReasonWhenItIsRefused) {
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_error()->set_text("this agent is of another team");
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().last_error(), "the destination refused: this agent is of another team");
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, IncludesRecordsStoredBeforeALaterOrder) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  source_.Insert(kSelf, proto::POWER, "q");
  Order();
  Acknowledge(sent[0]);
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().completed_sessions(), 1);
}

TEST_F(SharingSessionTest, NotesInStorageWhichRecordsWereSentAndAcknowledged) {
  const RecordKey key = source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(peer_haves_.back().handed_over_size(), 1);
  EXPECT_EQ(FromProto(peer_haves_.back().handed_over(0)), key);
  EXPECT_EQ(peer_haves_.back().peer(), kDestination);
  Acknowledge(sent[0]);
  EXPECT_TRUE(peer_haves_.back().is_session_closed());
  EXPECT_TRUE(FromProto(peer_haves_.back().acknowledged())->Get(key.stream).held.Contains(key.seq));
}

TEST_F(SharingSessionTest, StaysOpenWhenStorageCannotSayWhatIsMissing) {
  source_.Insert(kSelf, proto::POWER, "p");
  SharingActions actions = session_.Order(proto::RecordFilter(), now_);
  proto::Have have;
  have.set_session_id(actions.back().message.hello().session_id());
  have.set_is_whole(true);
  actions = session_.OnHave(have, now_);
  ASSERT_TRUE(actions.back().message.has_missing_request());
  proto::MissingReply failed;
  failed.set_remaining(1);
  EXPECT_TRUE(session_.OnMissingReply(actions.back().message.request_id(), failed, now_).empty());
  EXPECT_TRUE(session_.is_open());
  Advance(seconds(6));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ForgetsTheOrderWhenClosed) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  TakeSent();
  Take(session_.Close());
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_FALSE(session_.deadline());
}

TEST_F(SharingSessionTest, HasNothingRemainingOnceClosed) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  EXPECT_GT(Status().remaining(), 0);
  Take(session_.Close());
  EXPECT_EQ(Status().remaining(), 0);
}

TEST_F(SharingSessionTest, RefusesAMalformedHaveSet) {
  Order();
  proto::Have have;
  have.set_session_id(TakeHello());
  have.set_is_whole(true);
  have.mutable_have()->add_streams()->set_origin_agent(0);
  Take(session_.OnHave(have, now_));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_NE(Status().last_error(), "");
  EXPECT_EQ(Status().refused_haves(), 1);
}

TEST_F(SharingSessionTest, ShowsAtMostOneLineOfARefusal) {
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_error()->set_text("no\n\xFF" + std::string(1'000'000, 'x'));
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_LT(Status().last_error().size(), 400u);
  EXPECT_TRUE(proto::ShareSession().ParseFromString(Status().SerializeAsString())) << "UTF-8 as a client needs it";
}

TEST_F(SharingSessionTest, ObeysTheLowerOfItsOwnAndTheGrantedRate) {
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(5'000, now_);
  granted_rate_ = 2'000;
  Order();
  AnswerHello();
  EXPECT_EQ(Status().bytes_per_second_max(), 2'000);
  const std::size_t granted = BytesUntil(now_ + seconds(60));
  EXPECT_GT(granted, 2'000u * 50);
  EXPECT_LT(granted, 2'000u * 60 + 12 * 1024);
  EXPECT_EQ(Status().resends(), 0) << "waiting for the rate is no silence";

  granted_rate_ = 0;
  (void)BytesUntil(now_ + seconds(3));
  EXPECT_EQ(Status().bytes_per_second_max(), 5'000);
  const std::size_t own = BytesUntil(now_ + seconds(20));
  EXPECT_GT(own, 5'000u * 16);
  EXPECT_LT(own, 5'000u * 21);
}

TEST_F(SharingSessionTest, AVerySlowRateCausesNoResends) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(125, now_);
  Order();
  AnswerHello();
  (void)BytesUntil(now_ + seconds(300));
  EXPECT_EQ(Status().resends(), 0);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_FALSE(session_.is_open());
}

}  // namespace
}  // namespace moondb
