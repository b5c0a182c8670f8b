#include "apps/common/table.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(TableTest, AlignsWordsLeftAndNumbersRight) {
  Table table({"AGENT", "RECORDS", "ROLE"});
  table.Add({"rover1", "7", "leader"});
  table.Add({"b", "1200", "rover"});
  EXPECT_EQ(table.Text(),
            "AGENT   RECORDS  ROLE\n"
            "rover1        7  leader\n"
            "b          1200  rover\n");
}

TEST(TableTest, DoesNotPadTheLastCellOfARow) {
  Table table({"A", "B", "C"});
  table.Add({"x", "unreachable: it is not running"});
  table.Add({"y", "2", "z"});
  EXPECT_EQ(table.Text(), "A  B  C\nx  unreachable: it is not running\ny  2  z\n");
}

TEST(TableTest, CountsCharactersNotBytes) {
  Table table({"NAME", "N"});
  table.Add({"\xC3\x96rebro", "1"});
  table.Add({"Oslo", "2"});
  EXPECT_EQ(table.Text(), "NAME    N\n\xC3\x96rebro  1\nOslo    2\n");
}

TEST(TableTest, ShowsNoControlCharacters) {
  Table table({"A"});
  table.Add({"x\x1b[31m\ny"});
  EXPECT_EQ(table.Text(), "A\nx?[31m?y\n");
}

TEST(TableTest, FormatsForPeople) {
  EXPECT_EQ(FormatBytes(812), "812 B");
  EXPECT_EQ(FormatBytes(1.55e6), "1.6 MB");
  EXPECT_EQ(FormatSeconds(-1), "never");
  EXPECT_EQ(FormatSeconds(35), "35 s");
  EXPECT_EQ(FormatSeconds(600), "10 min");
  EXPECT_EQ(FormatSeconds(9000), "2.5 h");
  EXPECT_EQ(FormatUtc(1'671'300'425'310'699'520), "2022-12-17 18:07:05 UTC");
  EXPECT_EQ(FormatUtc(0), "-");
  EXPECT_EQ(FormatCount(12), "12");
  EXPECT_EQ(FormatCount(0, "record"), "0 records");
  EXPECT_EQ(FormatCount(1, "record"), "1 record");
}

}  // namespace
}  // namespace moondb
