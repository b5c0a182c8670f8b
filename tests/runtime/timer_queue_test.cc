#include "runtime/timer_queue.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace moondb {
namespace {

MonotonicTime At(int seconds) { return MonotonicTime(std::chrono::seconds(seconds)); }

std::string TakeAllDue(TimerQueue<char>& queue, MonotonicTime now) {
  std::string taken;
  while (const auto due = queue.TakeDue(now)) taken += due->second;
  return taken;
}

TEST(TimerQueueTest, OrdersTimersByTimeAndThenByAdding) {
  TimerQueue<char> queue;
  queue.Add(At(2), 'd');
  queue.Add(At(1), 'a');
  queue.Add(At(1), 'b');
  queue.Add(At(1), 'c');
  EXPECT_EQ(queue.NextDue(), At(1));
  EXPECT_EQ(TakeAllDue(queue, At(0)), "");
  EXPECT_EQ(TakeAllDue(queue, At(1)), "abc");
  EXPECT_EQ(TakeAllDue(queue, At(9)), "d");
  EXPECT_FALSE(queue.NextDue());
}

TEST(TimerQueueTest, CancelledTimersNeverFire) {
  TimerQueue<char> queue;
  const TimerId a = queue.Add(At(1), 'a');
  queue.Add(At(2), 'b');
  queue.Cancel(a);
  queue.Cancel(a);
  EXPECT_EQ(TakeAllDue(queue, At(9)), "b");
  queue.Cancel(a + 1);
  EXPECT_EQ(queue.size(), 0u);
}

TEST(TimerQueueTest, TakenValuesNameTheirDueTime) {
  TimerQueue<char> queue;
  queue.Add(At(3), 'a');
  EXPECT_EQ(queue.TakeDue(At(10))->first, At(3));
}

}  // namespace
}  // namespace moondb
