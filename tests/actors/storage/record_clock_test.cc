#include "actors/storage/record_clock.h"

#include <gtest/gtest.h>

#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kUtcNow_ns = 1'795'000'000 * kSecond_ns;  // In 2026.

class RecordClockTest : public testing::Test {
 protected:
  static RecordClock::Time At(int s) { return RecordClock::Time(std::chrono::seconds(s)); }

  // Returns whether a record with this timestamp is marked.
  bool IsMarked(std::int64_t timestamp_ns) {
    proto::InsertRequest request;
    *request.add_records() = TemperatureRecord(1);
    request.mutable_records(0)->set_timestamp_ns(timestamp_ns);
    (void)clock_.Judge(kUtcNow_ns, At(0));
    const auto marked = clock_.Mark(request, kUtcNow_ns, At(0));
    return marked && marked->records(0).is_clock_suspect();
  }

  RecordClock clock_{0};
};

TEST_F(RecordClockTest, MarksTimestampsBefore2020AndMoreThanADayAhead) {
  EXPECT_TRUE(IsMarked(0));
  EXPECT_TRUE(IsMarked(12 * kSecond_ns));
  EXPECT_TRUE(IsMarked(kTimestampMin_ns - 1));
  EXPECT_FALSE(IsMarked(kTimestampMin_ns));
  EXPECT_FALSE(IsMarked(kUtcNow_ns));
  EXPECT_FALSE(IsMarked(kUtcNow_ns + 24 * 3600 * kSecond_ns));
  EXPECT_TRUE(IsMarked(kUtcNow_ns + 24 * 3600 * kSecond_ns + 1));
  EXPECT_TRUE(IsMarked(INT64_MAX));
  EXPECT_TRUE(IsMarked(INT64_MIN));
}

TEST_F(RecordClockTest, MarksOnlyTheSuspectRecordsOfARequest) {
  proto::InsertRequest request;
  *request.add_records() = TemperatureRecord(1);
  *request.add_records() = TemperatureRecord(2);
  request.mutable_records(1)->set_timestamp_ns(kUtcNow_ns);
  (void)clock_.Judge(kUtcNow_ns, At(0));
  const auto marked = clock_.Mark(request, kUtcNow_ns, At(0));
  ASSERT_TRUE(marked);
  EXPECT_TRUE(marked->records(0).is_clock_suspect());
  EXPECT_FALSE(marked->records(1).is_clock_suspect());
}

TEST_F(RecordClockTest, MarksEverythingWhileItsOwnClockWasNeverSet) {
  (void)clock_.Judge(0, At(0));
  proto::InsertRequest request;
  *request.add_records() = TemperatureRecord(1);
  request.mutable_records(0)->set_timestamp_ns(kUtcNow_ns);
  EXPECT_TRUE(clock_.Mark(request, 0, At(0)));
  proto::StorageStatus status;
  clock_.Describe(0, At(0), status);
  EXPECT_NE(status.clock_suspect(), "");
  EXPECT_FALSE(status.has_suspect_timestamp()) << "the robot's software may have a right clock";
}

TEST_F(RecordClockTest, NamesTheLastSuspectTimestampForTenMinutes) {
  EXPECT_TRUE(IsMarked(12 * kSecond_ns));
  EXPECT_FALSE(IsMarked(kUtcNow_ns));
  proto::StorageStatus status;
  clock_.Describe(kUtcNow_ns, At(599), status);
  EXPECT_EQ(status.suspect_timestamp().data_type(), proto::TEMPERATURE);
  EXPECT_EQ(status.suspect_timestamp().timestamp_ns(), 12 * kSecond_ns);
  status.Clear();
  clock_.Describe(kUtcNow_ns, At(600), status);
  EXPECT_FALSE(status.has_suspect_timestamp());
}

}  // namespace
}  // namespace moondb
