#include "apps/common/csv.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(CsvTest, QuotesCellsWithSpecialCharacters) {
  EXPECT_EQ(CsvField("wheel slip"), "wheel slip");
  EXPECT_EQ(CsvField("a,b"), "\"a,b\"");
  EXPECT_EQ(CsvField("the \"hill\""), "\"the \"\"hill\"\"\"");
  EXPECT_EQ(CsvField("two\nlines"), "\"two\nlines\"");
  EXPECT_EQ(CsvField("a\r"), "\"a\r\"");
  EXPECT_EQ(CsvField(""), "\"\"");
}

}  // namespace
}  // namespace moondb
