#include "runtime/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

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

TEST_F(LogTest, WritesALineAnEvent) {
  ASSERT_TRUE(InitLog("info", "rover1", path_));
  spdlog::debug("storage: left out");
  spdlog::info("storage: ready");
  EXPECT_THAT(Text(),
              ::testing::MatchesRegex("[0-9]+-[0-9]+-[0-9]+T[0-9]+:[0-9]+:[0-9.]+Z info rover1 storage: ready\n"));
}

TEST_F(LogTest, RefusesAnUnknownLevel) {
  const Result<void> result = InitLog("warn1ng", "rover1");
  ASSERT_FALSE(result);
  EXPECT_EQ(ToString(result.error()),
            "level: expected trace, debug, info, warning, error, critical or off, got \"warn1ng\"; did you mean "
            "\"warning\"?");
  EXPECT_EQ(spdlog::default_logger(), before_);
}

TEST_F(LogTest, TellsThatTheFileCannotBeOpened) {
  EXPECT_EQ(InitLog("info", "rover1", "/dev/null/log").error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace moondb
