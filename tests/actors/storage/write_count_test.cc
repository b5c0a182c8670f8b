#include "actors/storage/write_count.h"

#include <gtest/gtest.h>

#include "proto/status.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

class WriteCountTest : public testing::Test {
 protected:
  std::map<std::uint32_t, double> Days(std::uint32_t today) {
    std::map<std::uint32_t, double> days;
    const Result<proto::StorageStatus> status = store_->GetStatus(today);
    EXPECT_TRUE(status);
    for (const proto::DayBytes& day : status->written()) days[day.day()] = day.bytes();
    return days;
  }

  void Reopen() {
    store_.reset();
    store_ = OpenStore(StoreOptionsOf(1, folder_.File("1.db"), ++seed_));
  }

  TemporaryFolder folder_;
  std::uint64_t seed_ = 1;
  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(1, folder_.File("1.db")));
};

TEST_F(WriteCountTest, ShowsBytesThatAreNotSavedYet) {
  const double before = Days(100)[100];
  InsertOne(*store_, TemperatureRecord(1));
  EXPECT_GT(Days(100)[100], before);
}

TEST_F(WriteCountTest, KeepsDaysAcrossARestart) {
  InsertOne(*store_, TemperatureRecord(1));
  ASSERT_TRUE(store_->SaveWritten(100));
  const double first = Days(100)[100];
  InsertOne(*store_, TemperatureRecord(2));
  ASSERT_TRUE(store_->SaveWritten(101));
  Reopen();
  // SaveWritten itself writes bytes, which count towards the next save.
  EXPECT_NEAR(Days(101)[100], first, 10'000);
  EXPECT_GT(Days(101)[101], 0);
}

TEST_F(WriteCountTest, SavesNothingIfNothingWasWritten) {
  ASSERT_TRUE(store_->SaveWritten(100));
  const std::uint64_t written = store_->database().WrittenBytes();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(store_->SaveWritten(100));
  EXPECT_EQ(store_->database().WrittenBytes(), written);
}

TEST_F(WriteCountTest, KeepsOnlyTheLastDays) {
  for (std::uint32_t day = 0; day < 2 * kWrittenDaysKept; ++day) {
    InsertOne(*store_, TemperatureRecord(day));
    ASSERT_TRUE(store_->SaveWritten(day));
  }
  Reopen();
  const auto days = Days(2 * kWrittenDaysKept - 1);
  EXPECT_EQ(days.size(), kWrittenDaysKept);
  EXPECT_EQ(days.begin()->first, kWrittenDaysKept);
  EXPECT_EQ(*store_->database().Number("SELECT count(*) FROM written"), static_cast<int>(kWrittenDaysKept));
}

}  // namespace
}  // namespace moondb
