#include "model/order_number.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(OrderNumberTest, ALaterOrderCoversEarlierOrdersOfTheSameProcess) {
  const std::uint64_t first = BeginOrderNumbers(7) + 1;
  EXPECT_TRUE(HasReached(first, first));
  EXPECT_TRUE(HasReached(first + 5, first));
  EXPECT_FALSE(HasReached(first, first + 1));
}

TEST(OrderNumberTest, OrdersOfTwoProcessesAreUnrelated) {
  const std::uint64_t before = BeginOrderNumbers(9) + 1000;
  const std::uint64_t now = BeginOrderNumbers(7) + 1;
  EXPECT_FALSE(HasReached(before, now));
  EXPECT_FALSE(HasReached(now, before));
}

TEST(OrderNumberTest, NoOrderCoversNoOrder) {
  EXPECT_FALSE(HasReached(0, 0));
  EXPECT_FALSE(HasReached(0, BeginOrderNumbers(0) + 1));
}

}  // namespace
}  // namespace moondb
