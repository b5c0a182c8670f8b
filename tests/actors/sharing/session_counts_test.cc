#include "actors/sharing/session_counts.h"

#include <gtest/gtest.h>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class SessionCountsTest : public SessionFixture {};

TEST_F(SessionCountsTest, CountsRecordsAcknowledgedSinceTheDestinationAnswered) {
  for (int i = 0; i < 200; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(100));
  Order();
  Advance(seconds(3));
  EXPECT_FALSE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);
  AnswerHello();
  EXPECT_TRUE(Status().is_remaining_known());
  EXPECT_EQ(Status().remaining(), 200);
  Advance(seconds(2));
  Acknowledge(TakeSent().front());
  EXPECT_EQ(Status().session_s(), 2);
  EXPECT_GT(Status().session_acknowledged_records(), 0);
  EXPECT_EQ(Status().session_acknowledged_records() + Status().remaining(), 200);
  EXPECT_GT(Status().session_acknowledged_bytes(), 100 * Status().session_acknowledged_records());

  // The destination connects again. Until it answers the Hello, the remaining count is unknown. The session's duration
  // counts from that answer.
  Advance(seconds(1));
  Take(session_.OnConnected(now_));
  EXPECT_FALSE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);
  Advance(seconds(1));
  AnswerHello();
  Advance(seconds(1));
  EXPECT_EQ(Status().session_s(), 1);
  EXPECT_EQ(Status().session_acknowledged_records(), 0);
  EXPECT_GT(Status().acknowledged_records(), 0);
  RunToEnd();
  EXPECT_TRUE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);

  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "one more");
  Order();
  Take(session_.Close());
  EXPECT_FALSE(Status().is_remaining_known());
}

TEST_F(SessionCountsTest, CountsEachKindOfEndSeparately) {
  SessionCounts counts;
  counts.ObserveEnd(Ending::kCompleted, {});
  counts.ObserveEnd(Ending::kCompleted, {});
  counts.ObserveEnd(Ending::kClosed, {});
  counts.ObserveEnd(Ending::kLimited, {});
  counts.ObserveResends(3);
  proto::ShareSession status;
  counts.AddTo(status, SessionCounts::Time(std::chrono::seconds(5)));
  EXPECT_EQ(status.completed_sessions(), 2);
  EXPECT_EQ(status.closed_sessions(), 1);
  EXPECT_EQ(status.limited_sessions(), 1);
  EXPECT_EQ(status.resends(), 3);
  EXPECT_EQ(status.seconds_since_end(), 5);
}

}  // namespace
}  // namespace moondb
