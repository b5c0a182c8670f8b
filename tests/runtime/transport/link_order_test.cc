#include "runtime/transport/link_order.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(LinkOrderTest, TheConnectionThatOpenedLastIsTheNewest) {
  LinkOrder order;
  EXPECT_TRUE(order.IsNewest(2, 1000));
  EXPECT_TRUE(order.IsNewest(2, 1000));
  EXPECT_TRUE(order.IsNewest(2, 1001));
  EXPECT_FALSE(order.IsNewest(2, 1000)) << "a late frame of the earlier connection";
  EXPECT_TRUE(order.IsNewest(2, 1001));
}

TEST(LinkOrderTest, AFirstFrameThatArrivesAfterANewerConnectionsIsNotTheNewest) {
  LinkOrder order;
  EXPECT_TRUE(order.IsNewest(2, 1001));
  EXPECT_FALSE(order.IsNewest(2, 1000));
  EXPECT_TRUE(order.IsNewest(2, 1001));
}

TEST(LinkOrderTest, ARestartedAgentNumbersFromAnywhere) {
  LinkOrder order;
  EXPECT_TRUE(order.IsNewest(2, 4'000'000'000));
  EXPECT_TRUE(order.IsNewest(2, 5)) << "a smaller number of a new process";
  EXPECT_FALSE(order.IsNewest(2, 4'000'000'000)) << "a late frame of the process before";
  EXPECT_TRUE(order.IsNewest(2, 6));
}

TEST(LinkOrderTest, CountsHowOftenAnEarlierProcessReturns) {
  LinkOrder order;
  EXPECT_EQ(order.returns(2), 0);
  for (const std::uint32_t number : {1000u, 1001u, 1002u, 5u, 1002u, 6u, 7u}) (void)order.IsNewest(2, number);
  EXPECT_EQ(order.returns(2), 0) << "one restart, and a late frame of the process before";
  for (const std::uint32_t number : {1003u, 8u, 7u, 1004u}) (void)order.IsNewest(2, number);
  EXPECT_EQ(order.returns(2), 3) << "two processes take turns";
  for (const std::uint32_t number : {70'000u, 900u}) (void)order.IsNewest(2, number);
  EXPECT_EQ(order.returns(2), 3) << "two further restarts";
  EXPECT_EQ(order.returns(3), 0);
}

TEST(LinkOrderTest, NumbersWrapAround) {
  LinkOrder order;
  EXPECT_TRUE(order.IsNewest(2, UINT32_MAX));
  EXPECT_TRUE(order.IsNewest(2, 1));
  EXPECT_FALSE(order.IsNewest(2, UINT32_MAX));
  EXPECT_FALSE(order.IsNewest(2, UINT32_MAX - 1)) << "never seen, but opened before";
}

TEST(LinkOrderTest, NumbersOfOneAgentDoNotAffectAnother) {
  LinkOrder order;
  EXPECT_TRUE(order.IsNewest(2, 1000));
  EXPECT_TRUE(order.IsNewest(3, 1001));
  EXPECT_TRUE(order.IsNewest(3, 1002));
  EXPECT_TRUE(order.IsNewest(2, 1000));
}

}  // namespace
}  // namespace moondb
