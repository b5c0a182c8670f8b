#include "actors/sharing/peer_orders.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::seconds;

constexpr std::uint64_t kOrder = 41;

class PeerOrdersTest : public testing::Test {
 protected:
  static PeerOrders::Options Options() { return {1, proto::SHARING_KIND_SYNC, seconds(5), seconds(20)}; }

  // Advances the time to the next deadline, and returns the orders sent then. Expects the deadline in `expected_s`
  // seconds. Returns nothing if there is no deadline.
  SharingActions NextAfter(int expected_s) {
    if (!orders_.deadline()) return {};
    EXPECT_EQ(*orders_.deadline() - now_, seconds(expected_s));
    now_ = *orders_.deadline();
    return orders_.OnTimer(now_);
  }

  PeerOrders orders_{Options()};
  PeerOrders::Time now_{};
};

TEST_F(PeerOrdersTest, AsksUntilThePeerAnswersWithAGrowingDelay) {
  EXPECT_FALSE(orders_.deadline());
  const SharingActions first = orders_.Place(2, 41, 0, now_);
  ASSERT_EQ(first.size(), 1u);
  EXPECT_EQ(first[0].to, 2u);
  EXPECT_EQ(first[0].message.request_id(), 41u);
  EXPECT_EQ(first[0].message.share_request().order(), 41u);
  EXPECT_EQ(first[0].message.share_request().destination(), 1u);
  EXPECT_EQ(first[0].message.share_request().kind(), proto::SHARING_KIND_SYNC);
  for (const int delay : {5, 10, 20, 20}) EXPECT_EQ(NextAfter(delay).size(), 1u);
  EXPECT_FALSE(orders_.TakeAnswer(2, 40, /*is_taken=*/true)) << "to an earlier order";
  EXPECT_FALSE(orders_.TakeAnswer(3, 41, /*is_taken=*/true)) << "of another peer";
  EXPECT_TRUE(orders_.TakeAnswer(2, 41, /*is_taken=*/true));
  EXPECT_FALSE(orders_.TakeAnswer(2, 41, /*is_taken=*/true));
  EXPECT_FALSE(orders_.deadline());
}

// A peer that connects again may have restarted and forgotten the order.
TEST_F(PeerOrdersTest, AsksAReconnectedPeerAgainIfItHasNotReportedTheEnd) {
  orders_.Place(2, kOrder, 0, now_);
  ASSERT_TRUE(orders_.TakeAnswer(2, kOrder, /*is_taken=*/true));
  EXPECT_EQ(orders_.OnConnected(2, now_).size(), 1u);
  EXPECT_EQ(NextAfter(5).size(), 1u) << "until it answers";
  ASSERT_TRUE(orders_.TakeAnswer(2, kOrder, /*is_taken=*/true));
  orders_.TakeEnd(2, kOrder - 1);
  EXPECT_EQ(orders_.OnConnected(2, now_).size(), 1u) << "an earlier order ended";
  ASSERT_TRUE(orders_.TakeAnswer(2, kOrder, /*is_taken=*/true));
  orders_.TakeEnd(2, kOrder);
  EXPECT_TRUE(orders_.OnConnected(2, now_).empty());
}

TEST_F(PeerOrdersTest, ForgetsOrdersThatThePeerRefused) {
  orders_.Place(2, kOrder, 0, now_);
  ASSERT_TRUE(orders_.TakeAnswer(2, kOrder, /*is_taken=*/false));
  EXPECT_TRUE(orders_.OnConnected(2, now_).empty());
}

TEST_F(PeerOrdersTest, AsksAReconnectedPeerAtOnce) {
  EXPECT_TRUE(orders_.OnConnected(2, now_).empty()) << "nothing is ordered";
  orders_.Place(2, 41, 0, now_);
  NextAfter(5);
  NextAfter(10);
  now_ += seconds(1);
  EXPECT_EQ(orders_.OnConnected(2, now_).size(), 1u);
  EXPECT_EQ(NextAfter(5).size(), 1u);
}

TEST_F(PeerOrdersTest, EachPeerHasItsOwnDelay) {
  orders_.Place(2, 41, 0, now_);
  NextAfter(5);
  orders_.Place(3, 42, 0, now_);
  const SharingActions next = NextAfter(5);
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next[0].to, 3u);
  EXPECT_EQ(NextAfter(5).at(0).to, 2u);
  orders_.Cancel(2);
  EXPECT_EQ(NextAfter(5).at(0).to, 3u);
  orders_.CancelAll();
  EXPECT_FALSE(orders_.deadline());
}

TEST_F(PeerOrdersTest, ALimitDoesNotNarrowAnOrderThatHasNone) {
  EXPECT_EQ(orders_.Place(2, 41, 500, now_)[0].message.share_request().bytes_max(), 500u);
  EXPECT_EQ(orders_.Place(2, 42, 700, now_)[0].message.share_request().bytes_max(), 700u);
  EXPECT_EQ(orders_.Place(2, 43, 0, now_)[0].message.share_request().bytes_max(), 0u);
  EXPECT_EQ(orders_.Place(2, 44, 500, now_)[0].message.share_request().bytes_max(), 0u);
  EXPECT_FALSE(orders_.TakeAnswer(2, 43, /*is_taken=*/true));
  EXPECT_TRUE(orders_.TakeAnswer(2, 44, /*is_taken=*/true));
}

}  // namespace
}  // namespace moondb
