#include "runtime/log.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "runtime/rate_limited_log.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

class LogTest : public ::testing::Test {
 protected:
  ~LogTest() override { spdlog::set_default_logger(before_); }

  std::string Text() const {
    std::ostringstream text;
    text << std::ifstream(path_).rdbuf();
    return text.str();
  }

  std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
  const TemporaryFolder temporary_;
  const std::string path_ = temporary_.File("agent.log");
};

TEST_F(LogTest, WritesOneLinePerEvent) {
  ASSERT_TRUE(InitLog("info", "rover1", path_));
  spdlog::debug("storage: left out");
  spdlog::info("storage: ready");
  EXPECT_THAT(Text(),
              ::testing::MatchesRegex("[0-9]+-[0-9]+-[0-9]+T[0-9]+:[0-9]+:[0-9.]+Z info rover1 storage: ready\n"));
}

TEST_F(LogTest, WritesALineOnceIfStderrIsTheFile) {
  const int stderr_before = ::dup(STDERR_FILENO);
  const int file = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  ASSERT_GE(::dup2(file, STDERR_FILENO), 0);
  const Result<void> begun = InitLog("info", "rover1", path_);
  spdlog::info("storage: ready");
  ::dup2(stderr_before, STDERR_FILENO);
  ::close(stderr_before);
  ::close(file);
  ASSERT_TRUE(begun);
  EXPECT_THAT(Text(), ::testing::MatchesRegex("[^\n]+ storage: ready\n"));
}

TEST_F(LogTest, LimitsLinesThatPeersCause) {
  ASSERT_TRUE(InitLog("info", "rover1", path_));
  RateLimitedLog log;
  RateLimitedLog changes(/*at_once=*/3);
  for (int i = 0; i < 1000; ++i) {
    log.Warn("a peer said something");
    changes.Info("rover2 is lost");
  }
  const std::string text = Text();
  const auto count = [&text](const std::string& part) {
    int found = 0;
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("warning rover1 a peer said something"), 1) << text;
  EXPECT_EQ(count("info rover1 rover2 is lost"), 3) << text;
}

// Parses the lines with protobuf's JSON parser, which is independent of the writer.
std::vector<google::protobuf::Struct> Parsed(const std::string& text) {
  std::vector<google::protobuf::Struct> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    const auto status = google::protobuf::util::JsonStringToMessage(line, &lines.emplace_back());
    EXPECT_TRUE(status.ok()) << line;
  }
  return lines;
}

std::string Field(const google::protobuf::Struct& line, const std::string& name) {
  const auto found = line.fields().find(name);
  return found == line.fields().end() ? "absent" : found->second.string_value();
}

TEST_F(LogTest, WritesOneJsonObjectPerLine) {
  ASSERT_TRUE(InitLog("debug", "rover1", path_, LogFormat::kJson));
  spdlog::warn("2/lease: refused the leases that agent 3 announced: driving_s: expected");
  spdlog::info("transport: rover2 is connected");
  spdlog::debug("actor 1/sync failed: why");
  spdlog::error("/data/moondb.sqlite: is damaged");
  spdlog::info("stopping");
  const auto lines = Parsed(Text());
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_THAT(Field(lines[0], "time"), ::testing::MatchesRegex("20[0-9][0-9]-[0-9]+-[0-9]+T[0-9]+:[0-9]+:[0-9.]+Z"));
  EXPECT_EQ(Field(lines[0], "level"), "warning");
  EXPECT_EQ(Field(lines[0], "agent"), "rover1");
  EXPECT_EQ(Field(lines[0], "actor"), "lease");
  EXPECT_EQ(Field(lines[0], "text"), "refused the leases that agent 3 announced: driving_s: expected");
  EXPECT_EQ(Field(lines[1], "actor"), "transport");
  EXPECT_EQ(Field(lines[2], "actor"), "sync");
  EXPECT_EQ(Field(lines[2], "text"), "actor 1/sync failed: why");
  EXPECT_EQ(Field(lines[3], "actor"), "absent");
  EXPECT_EQ(Field(lines[3], "text"), "/data/moondb.sqlite: is damaged");
  EXPECT_EQ(Field(lines[4], "text"), "stopping");
}

TEST_F(LogTest, EscapesTextInJsonLines) {
  ASSERT_TRUE(InitLog("info", "ro\"ver", path_, LogFormat::kJson));
  std::mt19937_64 random(1);
  std::vector<std::string> texts = {"quote \" back \\ line \n return \r nul \x01 del \x7F {\"a\":1}", ""};
  for (int i = 0; i < 200; ++i) {
    std::string& text = texts.emplace_back();
    for (std::uint64_t length = random() % 40; length > 0; --length) text += static_cast<char>(random());
  }
  for (const std::string& text : texts) spdlog::info("storage: {}", text);
  const auto lines = Parsed(Text());
  ASSERT_EQ(lines.size(), texts.size());
  EXPECT_EQ(Field(lines[0], "text"), texts[0]);
  EXPECT_EQ(Field(lines[0], "agent"), "ro\"ver");
  for (const auto& line : lines) EXPECT_EQ(Field(line, "actor"), "storage");
}

TEST_F(LogTest, RefusesAnUnknownLevel) {
  const Result<void> result = InitLog("warn1ng", "rover1");
  ASSERT_FALSE(result);
  EXPECT_EQ(ToString(result.error()),
            "level: expected trace, debug, info, warning, error, critical or off, got \"warn1ng\"; did you mean "
            "\"warning\"?");
  EXPECT_EQ(spdlog::default_logger(), before_);
}

TEST_F(LogTest, ReportsThatTheFileCannotBeOpened) {
  EXPECT_EQ(InitLog("info", "rover1", "/dev/null/log").error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace moondb
