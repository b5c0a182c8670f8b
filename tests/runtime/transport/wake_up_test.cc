#include "runtime/transport/wake_up.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>

namespace moondb {
namespace {

using std::chrono::milliseconds;

class WakeUpTest : public testing::Test {
 protected:
  bool is_rung() const {
    pollfd file{wake_up_.file(), POLLIN, 0};
    return poll(&file, 1, /*timeout=*/0) == 1;
  }

  static MonotonicTime At(int ms) { return MonotonicTime(milliseconds(ms)); }

  WakeUp wake_up_;
};

TEST_F(WakeUpTest, RingsIfTheThreadWouldSleepLonger) {
  wake_up_.IsLooking();
  wake_up_.SleepsUntil(At(100));
  wake_up_.RingFor(At(100));
  wake_up_.RingFor(At(200));
  EXPECT_FALSE(is_rung());
  wake_up_.RingFor(At(99));
  EXPECT_TRUE(is_rung());
  wake_up_.IsAwake(/*by_file=*/true);
  EXPECT_FALSE(is_rung());
}

TEST_F(WakeUpTest, DoesNotRingWhileTheThreadIsAwake) {
  wake_up_.RingFor();
  EXPECT_FALSE(is_rung());
}

TEST_F(WakeUpTest, RingsIfTheThreadIsLookingAndMayHaveMissedIt) {
  wake_up_.IsLooking();
  wake_up_.RingFor(At(1'000'000));
  EXPECT_TRUE(is_rung());
  wake_up_.SleepsUntil(At(100));
  EXPECT_TRUE(is_rung());
}

TEST_F(WakeUpTest, RingsOnceForManyEventsAndAgainAfterwards) {
  wake_up_.IsLooking();
  wake_up_.SleepsUntil(MonotonicTime::max());
  for (int i = 0; i < 10; ++i) wake_up_.RingFor();
  wake_up_.IsAwake(/*by_file=*/true);
  EXPECT_FALSE(is_rung());
  wake_up_.IsLooking();
  wake_up_.SleepsUntil(MonotonicTime::max());
  wake_up_.RingFor();
  EXPECT_TRUE(is_rung());
}

}  // namespace
}  // namespace moondb
