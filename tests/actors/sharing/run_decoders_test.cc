#include "actors/sharing/run_decoders.h"

#include <gtest/gtest.h>

#include "tests/actors/sharing/coding/records.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class RunDecodersTest : public testing::Test {
 protected:
  // Returns the encoder's next batch, with two maps.
  proto::Batch NextBatch() {
    CodedBatch coded = encoder_.Encode(proto::CODEC_COMPACT, MapBatch(map_count_, 2), 1'000'000);
    map_count_ += 2;
    proto::Batch batch;
    batch.set_codec(coded.codec);
    batch.set_coded(coded.bytes);
    batch.set_record_count(static_cast<std::uint32_t>(coded.record_count));
    batch.set_run(coded.run);
    return batch;
  }

  // Returns true if the batch was decoded, and false if it depends on batches that are missing. Any other error fails
  // the test.
  bool IsDecoded(AgentId sender, const proto::Batch& batch) {
    const auto records = runs_.Decode(sender, batch, batch.coded(), now_);
    if (!records) {
      EXPECT_EQ(records.error().code, ErrorCode::kNotFound) << ToString(records.error());
    }
    return records.has_value();
  }

  SharingEncoder encoder_{{}, 7};
  RunDecoders runs_{2, seconds(60)};
  RunDecoders::Time now_{};
  int map_count_ = 0;
};

TEST_F(RunDecodersTest, KeepsNoRunForASenderWithoutAPlace) {
  const proto::Batch first = NextBatch(), second = NextBatch();
  EXPECT_TRUE(IsDecoded(2, first));
  EXPECT_FALSE(IsDecoded(2, second));
  EXPECT_TRUE(runs_.TakePlace(2, now_));
  EXPECT_TRUE(IsDecoded(2, first));
  EXPECT_TRUE(IsDecoded(2, second));
}

TEST_F(RunDecodersTest, SendersHaveRunsOfTheirOwn) {
  const proto::Batch first = NextBatch(), second = NextBatch();
  EXPECT_TRUE(runs_.TakePlace(2, now_));
  EXPECT_TRUE(runs_.TakePlace(3, now_));
  EXPECT_TRUE(IsDecoded(2, first));
  EXPECT_FALSE(IsDecoded(3, second));
  EXPECT_TRUE(IsDecoded(3, first));
  EXPECT_TRUE(IsDecoded(3, second));
  EXPECT_TRUE(IsDecoded(2, second));
}

TEST_F(RunDecodersTest, ARunStaysUntilItsSenderBeginsAnother) {
  EXPECT_TRUE(runs_.TakePlace(2, now_));
  EXPECT_TRUE(IsDecoded(2, NextBatch()));
  const proto::Batch of_first_run = NextBatch();
  encoder_.BeginRun();
  const proto::Batch begins = NextBatch(), goes_on = NextBatch();
  EXPECT_FALSE(IsDecoded(2, goes_on));
  EXPECT_TRUE(IsDecoded(2, of_first_run));
  EXPECT_TRUE(IsDecoded(2, begins));
  EXPECT_TRUE(IsDecoded(2, goes_on));
  EXPECT_FALSE(IsDecoded(2, of_first_run));
}

TEST_F(RunDecodersTest, ASenderLosesItsPlaceOnlyAfterSilence) {
  EXPECT_TRUE(runs_.TakePlace(2, now_));
  EXPECT_TRUE(runs_.TakePlace(3, now_));
  const proto::Batch first = NextBatch(), second = NextBatch();
  now_ += seconds(50);
  EXPECT_TRUE(IsDecoded(3, first));
  now_ += seconds(20);
  EXPECT_TRUE(runs_.TakePlace(4, now_)) << "agent 2 was silent for 70 s";
  EXPECT_FALSE(runs_.TakePlace(5, now_));
  EXPECT_TRUE(IsDecoded(3, second));
  EXPECT_TRUE(runs_.TakePlace(3, now_)) << "it has one";
}

}  // namespace
}  // namespace moondb
