#include "apps/moonctl/time_span_option.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

constexpr std::int64_t kNow_ns = 1'800'000'000'000'000'000;

TEST(TimeSpanOptionTest, TakesATimeInUtcOrAnAge) {
  EXPECT_EQ(ParseTimeOrAge("2026-11-22T06:00Z", kNow_ns, "--since"), 1'795'327'200'000'000'000);
  EXPECT_EQ(ParseTimeOrAge("10m", kNow_ns, "--since"), kNow_ns - 600'000'000'000);
  EXPECT_EQ(ParseTimeOrAge("30d", kNow_ns, "--since"), kNow_ns - 30 * 86'400'000'000'000);
  for (const char* bad : {"", "yesterday", "-5m", "2026-11-22", "1e99d", "2026-13-01T00:00Z"}) {
    const Result<std::int64_t> time = ParseTimeOrAge(bad, kNow_ns, "--since");
    ASSERT_FALSE(time) << bad;
    EXPECT_EQ(time.error().field, "--since");
  }
}

TEST(TimeSpanOptionTest, SetsTheTimesThatWereGiven) {
  proto::ReadRequest request;
  EXPECT_TRUE(SetTimes({}, kNow_ns, request));
  EXPECT_EQ(request.from_presence_case(), proto::ReadRequest::FROM_PRESENCE_NOT_SET);
  EXPECT_EQ(request.to_presence_case(), proto::ReadRequest::TO_PRESENCE_NOT_SET);
  EXPECT_TRUE(SetTimes({"10m", "5m"}, kNow_ns, request));
  EXPECT_EQ(request.to_ns() - request.from_ns(), 300'000'000'000);
  const Result<void> reversed = SetTimes({"5m", "10m"}, kNow_ns, request);
  ASSERT_FALSE(reversed);
  EXPECT_EQ(reversed.error().field, "--since");
}

}  // namespace
}  // namespace moondb
