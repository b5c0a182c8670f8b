#include "model/duration.h"

#include <gtest/gtest.h>

#include "model/keep_rule.h"

namespace moondb {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

TEST(DurationTest, ReadsNumbersWithUnits) {
  EXPECT_EQ(ParseDuration("90"), seconds(90));
  EXPECT_EQ(ParseDuration("500ms"), milliseconds(500));
  EXPECT_EQ(ParseDuration("1.5h"), minutes(90));
  EXPECT_EQ(ParseDuration("2min"), minutes(2));
  EXPECT_EQ(ParseDuration("2m"), minutes(2));
  EXPECT_EQ(ParseDuration("1d"), hours(24));
  EXPECT_EQ(ParseDuration("30d", hours(24 * 31)), hours(24 * 30));
}

TEST(DurationTest, RefusesWhatIsNoDurationOrTooLong) {
  for (const char* text : {"", "d", "7 d", "-1s", "0", "0d", "1w", "1e3s", "nan", "inf", "1d1h", "1..5s", "0.1ms",
                           "25h", "2d", "99999999999999999999d"}) {
    EXPECT_FALSE(ParseDuration(text)) << text;
  }
}

TEST(DurationTest, WritesTheLargestUnitThatIsWhole) {
  EXPECT_EQ(FormatDuration(hours(168)), "7d");
  EXPECT_EQ(FormatDuration(hours(36)), "36h");
  EXPECT_EQ(FormatDuration(minutes(90)), "90m");
  EXPECT_EQ(FormatDuration(seconds(90)), "90s");
  EXPECT_EQ(FormatDuration(milliseconds(1500)), "1500ms");
  EXPECT_EQ(ParseDuration(FormatDuration(hours(36)), hours(48)), hours(36));
}

TEST(KeepRuleTest, ReadsAllLatestAndDurationsWithTheirUnit) {
  EXPECT_TRUE(ParseKeepRule("all")->IsOfAnyAge());
  EXPECT_FALSE(ParseKeepRule("latest")->KeepsAny());
  EXPECT_EQ(ParseKeepRule("7d")->at_most, hours(168));
  EXPECT_EQ(ToString(*ParseKeepRule("168h")), "7d");
  EXPECT_EQ(ToString(*ParseKeepRule("all")), "all");
  EXPECT_EQ(ToString(*ParseKeepRule("latest")), "latest");
  for (const char* text : {"", "none", "7", "0d", "500ms", "5000ms", "1.5s", "-7d", "36501d", "All", "7 d"}) {
    EXPECT_FALSE(ParseKeepRule(text)) << text;
  }
}

}  // namespace
}  // namespace moondb
