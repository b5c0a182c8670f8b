#include "model/text.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <limits>
#include <random>

#include "model/text_lines.h"

namespace moondb {
namespace {

using testing::ElementsAre;

TEST(TextTest, TimestampsAreConvertedWithoutADouble) {
  EXPECT_EQ(ParseTimestampNs("1671300425.3106995"), 1671300425310699500);
  EXPECT_EQ(ParseTimestampNs("1248362857.900000095"), 1248362857900000095);
  EXPECT_EQ(ParseTimestampNs("-0.5"), -500000000);
  EXPECT_EQ(ParseTimestampNs("0.9999999996"), 1000000000);
  EXPECT_EQ(ParseTimestampNs("10."), 10000000000);
  EXPECT_EQ(ParseTimestampNs("1730477379787663104.000000000"), 1730477379787663104) << "nanoseconds";
  for (const char* bad : {"", "-", ".", "1e3", "nan", "1.5x", "1.2.3", "99999999999", "--1"}) {
    EXPECT_FALSE(ParseTimestampNs(bad)) << bad;
  }
  for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1671300425310699513},
                                std::int64_t{10000000000}, std::int64_t{-1500000000}}) {
    EXPECT_EQ(ParseTimestampNs(FormatTimestampNs(ns)), ns);
  }
  EXPECT_EQ(FormatTimestampNs(10'000'000'000), "10");
  EXPECT_EQ(FormatTimestampNs(std::numeric_limits<std::int64_t>::min()), "-9223372036.854775808");
}

TEST(TextTest, NumbersRoundTripExactly) {
  for (const double value : {0.1, 1.0 / 3, 1e-300, -2.5e17, 0.1 + 0.2, std::numeric_limits<double>::denorm_min()}) {
    EXPECT_EQ(ParseDouble(FormatDouble(value)), value);
  }
  EXPECT_EQ(ParseDouble("+1.5"), 1.5);
  for (const char* bad : {"", " 1", "1 ", "nan", "inf", "1e999", "0x10", "1,5"}) EXPECT_FALSE(ParseDouble(bad)) << bad;
  EXPECT_FALSE(ParseUnsigned("-1"));
  EXPECT_FALSE(ParseUnsigned("18446744073709551616"));
}

TEST(TextTest, SplitsLinesAndFields) {
  std::string_view text = "a\r\nb\n\nc";
  EXPECT_EQ(TakeLine(text), "a");
  EXPECT_EQ(TakeLine(text), "b");
  EXPECT_EQ(TakeLine(text), "");
  EXPECT_EQ(TakeLine(text), "c");
  EXPECT_TRUE(text.empty());
  EXPECT_THAT(Split("a,,b,", ','), ElementsAre("a", "", "b", ""));
  EXPECT_THAT(Split("  a \t b ", ' '), ElementsAre("a", "b"));
}

TEST(TextTest, FilesBeyondTheLimitAreRefused) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("moondb_text_test" + std::to_string(getpid()));
  ASSERT_TRUE(WriteTextFile(file, "0123456789"));
  EXPECT_EQ(*ReadTextFile(file), "0123456789");
  EXPECT_EQ(ReadTextFile(file, 9).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(ReadTextFile(testing::TempDir()).error().code, ErrorCode::kInvalid);
  std::filesystem::remove(file);
  EXPECT_EQ(ReadTextFile(file).error().code, ErrorCode::kNotFound);
}

TEST(TextTest, KnowsUtf8) {
  for (const char* text : {"", "regolith", "m\u00b3", "\xF0\x9F\x8C\x99"}) EXPECT_TRUE(IsUtf8(text)) << text;
  for (const char* text : {"\xFF", "a\xC3", "\xC0\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80"}) EXPECT_FALSE(IsUtf8(text));
}

TEST(TextTest, ShowsUntrustedTextAsOneLineOfUtf8) {
  EXPECT_EQ(OneLine("disk is full"), "disk is full");
  EXPECT_EQ(OneLine("m\u00b3\n\x1b[2J\xFF"), "m\u00b3??[2J?");
  EXPECT_EQ(OneLine(std::string(1000, 'x'), 3), "xxx...");
}

TEST(TextLinesTest, AFileGivesTheSameLinesAsItsText) {
  const std::uint64_t seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  const std::string file = testing::TempDir() + "moondb_text_lines";
  for (int i = 0; i < 20; ++i) {
    std::string text;
    for (std::uint64_t line = 0; line < rng() % 200; ++line) {
      text += std::string(rng() % (rng() % 8 == 0 ? 60'000 : 50), 'x') + (rng() % 2 == 0 ? "\n" : "\r\n");
    }
    if (rng() % 2 == 0) text += "no newline at the end";
    ASSERT_TRUE(WriteTextFile(file, text));
    TextLines expected(text);
    TextLines lines = *TextLines::OfFile(file);
    while (const auto line = expected.Next()) {
      ASSERT_EQ(lines.Next(), line);
      EXPECT_EQ(lines.number(), expected.number());
    }
    EXPECT_EQ(lines.Next(), std::nullopt);
    EXPECT_TRUE(lines.result());
  }
}

TEST(TextLinesTest, ALineWithoutAnEndIsAnError) {
  const std::string file = testing::TempDir() + "moondb_endless_line";
  ASSERT_TRUE(WriteTextFile(file, "first\n" + std::string(1'000'000, 'x')));
  TextLines lines = *TextLines::OfFile(file);
  EXPECT_EQ(lines.Next(), "first");
  EXPECT_EQ(lines.Next(), std::nullopt);
  ASSERT_FALSE(lines.result());
  EXPECT_EQ(lines.result().error().code, ErrorCode::kInvalid);
  EXPECT_EQ(lines.result().error().field, file + ":2");
}

}  // namespace
}  // namespace moondb
