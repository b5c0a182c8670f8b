#include "runtime/link_credit.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(LinkCreditTest, LetsNoMoreOutThanTheCreditBeyondWhatIsReported) {
  LinkCredit credit(100);
  credit.Open(7);
  EXPECT_TRUE(credit.HasRoomFor(100));
  credit.OnSent(60);
  EXPECT_TRUE(credit.HasRoomFor(40));
  EXPECT_FALSE(credit.HasRoomFor(41));
  credit.OnSent(40);
  EXPECT_FALSE(credit.HasRoomFor(1));
  EXPECT_TRUE(credit.OnReport(7, 60));
  EXPECT_EQ(credit.unreported_bytes(), 40u);
  EXPECT_TRUE(credit.HasRoomFor(60));
}

TEST(LinkCreditTest, LetsOneLargerFrameGoAlone) {
  LinkCredit credit(100);
  credit.Open(7);
  EXPECT_TRUE(credit.HasRoomFor(1000));
  credit.OnSent(1000);
  EXPECT_FALSE(credit.HasRoomFor(1));
  EXPECT_TRUE(credit.OnReport(7, 1000));
  credit.OnSent(1);
  EXPECT_FALSE(credit.HasRoomFor(1000));
}

TEST(LinkCreditTest, RefusesReportsThatCannotBe) {
  LinkCredit credit(100);
  credit.Open(7);
  credit.OnSent(50);
  EXPECT_FALSE(credit.OnReport(7, 51)) << "more than was sent";
  EXPECT_FALSE(credit.OnReport(6, 50)) << "of another connection";
  EXPECT_FALSE(credit.has_report());
  EXPECT_TRUE(credit.OnReport(7, 30));
  EXPECT_FALSE(credit.OnReport(7, 29)) << "backwards";
  EXPECT_TRUE(credit.OnReport(7, 30));
  EXPECT_EQ(credit.unreported_bytes(), 20u);
}

TEST(LinkCreditTest, BeginsAnewWithEachConnection) {
  LinkCredit credit(100);
  credit.Open(7);
  credit.OnSent(100);
  credit.Open(8);
  EXPECT_EQ(credit.unreported_bytes(), 0u);
  EXPECT_FALSE(credit.OnReport(7, 0));
  credit.OnSent(100);
  EXPECT_FALSE(credit.HasRoomFor(1));
  credit.Renew();
  EXPECT_TRUE(credit.HasRoomFor(100));
}

TEST(ReceivedCountTest, ReportsAfterSoManyBytes) {
  ReceivedCount received;
  received.OnReceived(1000);
  EXPECT_FALSE(received.is_report_due()) << "nobody to tell";
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

}  // namespace
}  // namespace moondb
