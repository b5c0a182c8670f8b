#include "actors/sharing/resend_delay.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class ResendDelayTest : public SessionFixture {};

// The destination acknowledges the record's fragments, but refuses to store the record. Acknowledged fragments must not
// count as progress.
TEST_F(ResendDelayTest, RetriesALargeRecordThatCannotBeStoredLessAndLessOften) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(10'000));
  Order();
  std::size_t hellos = 0;
  for (int i = 0; i < 1000; ++i) {  // 100 s in steps of 100 ms.
    Advance(std::chrono::milliseconds(100));
    for (const proto::Message& message : TakeSent()) {
      if (message.has_hello()) {
        ++hellos;
        sent_.push_back(message);
        AnswerHello();
      } else if (const auto whole = *fragments_.Take(kSelf, message.batch()); !whole) {
        Take(session_.OnHave(AcknowledgmentOf(message.batch()), now_));
      } else {
        proto::Refusal full;
        full.set_session_id(message.batch().session_id());
        full.mutable_error()->set_code(proto::ERROR_CODE_UNAVAILABLE);
        Take(session_.OnRefusal(full, now_));
      }
    }
  }
  EXPECT_GE(hellos, 3u);
  EXPECT_LE(hellos, 6u) << "after 5, 10, 20 and 30 s";
}

TEST_F(ResendDelayTest, StartsOverOnceWhenTheDestinationForgotTheSession) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_NOT_FOUND);
  Take(session_.OnRefusal(refusal, now_));
  refusal.set_session_id(TakeHello());
  Take(session_.OnRefusal(refusal, now_));
  // After the second refusal the session waits, so it does not send Hellos in a tight loop.
  EXPECT_TRUE(TakeSent().empty());
  Advance(seconds(6));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(ResendDelayTest, RetriesADestinationThatNeverReadsARunLessAndLessOften) {
  OrderMaps(60);
  const auto answer_all = [this] {
    std::size_t count = 0;
    for (std::vector<proto::Message> sent = TakeSent(); !sent.empty() && count < 100; sent = TakeSent()) {
      for (const proto::Message& message : sent) {
        if (!message.has_batch()) continue;
        proto::Have have = AcknowledgmentOf(message.batch());
        have.set_needs_new_run(true);
        Take(session_.OnHave(have, now_));
        ++count;
      }
    }
    return count;
  };
  constexpr std::size_t kInFlightMax = 6;
  EXPECT_LE(answer_all(), 2 * kInFlightMax);
  Advance(seconds(6));
  AnswerHello();
  EXPECT_LE(answer_all(), kInFlightMax);
}

TEST_F(ResendDelayTest, DoublesUpToTheLimitAndResetsAfterProgress) {
  ResendDelay delay(seconds(5), seconds(30));
  for (const int expected : {5, 10, 20, 30, 30}) {
    EXPECT_EQ(delay.delay(), seconds(expected));
    delay.Grow();
  }
  EXPECT_TRUE(delay.has_grown());
  delay.ObserveProgress(/*has_records=*/false);
  EXPECT_EQ(delay.delay(), seconds(5));
  EXPECT_FALSE(delay.has_grown());
}

TEST_F(ResendDelayTest, AfterARefusalOnlyRecordsAreProgress) {
  ResendDelay delay(seconds(5), seconds(30));
  delay.Grow();
  delay.ObserveRefusal();
  delay.ObserveProgress(/*has_records=*/false);
  EXPECT_EQ(delay.delay(), seconds(10));
  delay.ObserveProgress(/*has_records=*/true);
  EXPECT_EQ(delay.delay(), seconds(5));
  delay.Grow();
  delay.ObserveProgress(/*has_records=*/false);
  EXPECT_EQ(delay.delay(), seconds(5)) << "nothing was refused since";
}

TEST_F(ResendDelayTest, StartsOverImmediatelyOncePerProgress) {
  ResendDelay delay(seconds(5), seconds(30));
  EXPECT_TRUE(delay.TakeStartAtOnce());
  EXPECT_FALSE(delay.TakeStartAtOnce());
  delay.Grow();
  EXPECT_FALSE(delay.TakeStartAtOnce());
  delay.ObserveProgress(/*has_records=*/true);
  EXPECT_TRUE(delay.TakeStartAtOnce());
}

}  // namespace
}  // namespace moondb
