#include "runtime/transport/link_credit.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::milliseconds;

constexpr LinkCredit::Options kFixed{.bytes_min = 100, .bytes_max = 100};
constexpr MonotonicTime kNow{std::chrono::seconds(1000)};

TEST(LinkCreditTest, SendsNoMoreThanTheCreditBeyondReportedBytes) {
  LinkCredit credit(kFixed);
  credit.Open(7);
  EXPECT_TRUE(credit.HasRoomFor(100));
  credit.OnSent(kNow, 60);
  EXPECT_TRUE(credit.HasRoomFor(40));
  EXPECT_FALSE(credit.HasRoomFor(41));
  credit.OnSent(kNow, 40);
  EXPECT_FALSE(credit.HasRoomFor(1));
  EXPECT_TRUE(credit.OnReport(kNow, 7, 60));
  EXPECT_EQ(credit.unreported_bytes(), 40u);
  EXPECT_TRUE(credit.HasRoomFor(60));
}

TEST(LinkCreditTest, SendsOneLargerFrameByItself) {
  LinkCredit credit(kFixed);
  credit.Open(7);
  EXPECT_TRUE(credit.HasRoomFor(1000));
  credit.OnSent(kNow, 1000);
  EXPECT_FALSE(credit.HasRoomFor(1));
  EXPECT_TRUE(credit.OnReport(kNow, 7, 1000));
  credit.OnSent(kNow, 1);
  EXPECT_FALSE(credit.HasRoomFor(1000));
}

TEST(LinkCreditTest, RefusesInvalidReports) {
  LinkCredit credit(kFixed);
  credit.Open(7);
  credit.OnSent(kNow, 50);
  EXPECT_FALSE(credit.OnReport(kNow, 7, 51)) << "more than was sent";
  EXPECT_FALSE(credit.OnReport(kNow, 6, 50)) << "of another connection";
  EXPECT_TRUE(credit.OnReport(kNow, 7, 30));
  EXPECT_FALSE(credit.OnReport(kNow, 7, 29)) << "backwards";
  EXPECT_TRUE(credit.OnReport(kNow, 7, 30));
  EXPECT_EQ(credit.unreported_bytes(), 20u);
}

TEST(LinkCreditTest, RestartsWithEachConnection) {
  LinkCredit credit(kFixed);
  credit.Open(7);
  credit.OnSent(kNow, 100);
  credit.Open(8);
  EXPECT_EQ(credit.unreported_bytes(), 0u);
  EXPECT_FALSE(credit.OnReport(kNow, 7, 0));
  credit.OnSent(kNow, 100);
  EXPECT_FALSE(credit.HasRoomFor(1));
  EXPECT_TRUE(credit.OnReport(kNow, 8, 100));
  EXPECT_TRUE(credit.HasRoomFor(100));
}

// Sends the whole credit `rounds` times. Each time, the peer reports after the time `round` that it received all bytes.
// Returns the final credit in bytes.
std::size_t CreditAfterRounds(LinkCredit& credit, int rounds, Duration round, bool is_blocked = true) {
  MonotonicTime now = kNow;
  std::uint64_t sent = 0;
  for (int i = 0; i < rounds; ++i) {
    const std::size_t bytes = credit.credit_bytes();
    credit.OnSent(now, bytes);
    sent += bytes;
    if (is_blocked) credit.OnBlocked();
    now += round;
    EXPECT_TRUE(credit.OnReport(now, credit.link(), sent));
    now += std::chrono::seconds(10);  // Idle time between rounds does not count.
  }
  return credit.credit_bytes();
}

TEST(LinkCreditTest, GrowsOnAFastLinkUpToItsLimit) {
  LinkCredit credit({.bytes_min = 100, .bytes_max = 500, .round_fast = milliseconds(10)});
  credit.Open(7);
  EXPECT_EQ(CreditAfterRounds(credit, 2, milliseconds(10)), 400u);
  credit.Open(8);
  EXPECT_EQ(credit.credit_bytes(), 100u) << "the next connection may be another radio";
  EXPECT_EQ(CreditAfterRounds(credit, 5, milliseconds(10)), 500u);
}

TEST(LinkCreditTest, StaysSmallOnASlowLinkOrIfItIsNotUsedUp) {
  LinkCredit credit({.bytes_min = 100, .bytes_max = 500, .round_fast = milliseconds(10)});
  credit.Open(7);
  EXPECT_EQ(CreditAfterRounds(credit, 5, milliseconds(11)), 100u);
  credit.Open(8);
  EXPECT_EQ(CreditAfterRounds(credit, 5, milliseconds(1), /*is_blocked=*/false), 100u);
}

TEST(LinkCreditTest, ShrinksWhenTheLinkSlowsDown) {
  LinkCredit credit({.bytes_min = 100, .bytes_max = 500, .round_fast = milliseconds(10)});
  credit.Open(7);
  EXPECT_EQ(CreditAfterRounds(credit, 2, milliseconds(1)), 400u);
  credit.OnSent(kNow, 400);
  EXPECT_TRUE(credit.OnReport(kNow + milliseconds(41), 7, 100 + 200 + 400));
  EXPECT_EQ(credit.credit_bytes(), 200u);
}

TEST(ReceivedCountTest, ReportsAfterAGivenNumberOfBytes) {
  ReceivedCount received;
  received.OnReceived(1000);
  EXPECT_FALSE(received.is_report_due()) << "nobody to notify";
  EXPECT_TRUE(received.OnLink(7));
  received.SetReportAfter(100);
  EXPECT_EQ(received.received_bytes(), 0u);
  received.OnReceived(99);
  EXPECT_FALSE(received.is_report_due());
  received.OnReceived(1);
  EXPECT_TRUE(received.is_report_due());
  received.OnReported();
  EXPECT_FALSE(received.is_report_due());
  EXPECT_EQ(received.received_bytes(), 100u);
  EXPECT_FALSE(received.OnLink(7));
  EXPECT_EQ(received.received_bytes(), 100u);
  EXPECT_TRUE(received.OnLink(8));
  EXPECT_EQ(received.received_bytes(), 0u);
}

TEST(LargeFrameNoticeTest, CoversOnlyTheNextFrame) {
  LargeFrameNotice notice;
  EXPECT_FALSE(notice.Covers(50'000));
  notice.OnReportSent(50'000);
  EXPECT_TRUE(notice.Covers(50'000));
  EXPECT_FALSE(notice.Covers(60'000)) << "another frame has become the next one";
  notice.OnFrameSent();  // A control message is sent while the socket has no room for the large frame.
  EXPECT_FALSE(notice.Covers(50'000));
  notice.OnReportSent(50'000);
  notice.OnReportSent(0);
  EXPECT_FALSE(notice.Covers(50'000));
}

}  // namespace
}  // namespace moondb
