#include "apps/common/data_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "tests/temporary_folder.h"

namespace moondb {
namespace {

class DataFolderTest : public testing::Test {
 protected:
  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path() / "data";
};

TEST_F(DataFolderTest, LiesBesideTheTeamFile) {
  EXPECT_EQ(DefaultDataFolder("/etc/moon/team.yaml", "rover1"), "/etc/moon/moondb-data/rover1");
}

TEST_F(DataFolderTest, BelongsToOneAtATime) {
  EXPECT_EQ(OwnerOf(folder_), 0);
  {
    const auto first = DataFolderLock::Take(folder_);
    ASSERT_TRUE(first.has_value()) << ToString(first.error());
    EXPECT_EQ(OwnerOf(folder_), ::getpid());
    const auto second = DataFolderLock::Take(folder_);
    ASSERT_FALSE(second.has_value());
    EXPECT_EQ(second.error().code, ErrorCode::kRefused);
    EXPECT_EQ(OwnerOf(folder_), ::getpid());  // Asking frees nothing.
  }
  EXPECT_EQ(OwnerOf(folder_), 0);
  EXPECT_TRUE(DataFolderLock::Take(folder_).has_value());
}

TEST_F(DataFolderTest, TakesALeftOverPidFileForNothing) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ / "agent.pid") << "1\n";
  EXPECT_EQ(OwnerOf(folder_), 0);
  EXPECT_TRUE(DataFolderLock::Take(folder_).has_value());
}

TEST_F(DataFolderTest, SaysWhyAFolderCannotBeMade) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ / "file") << "x";
  const auto lock = DataFolderLock::Take(folder_ / "file" / "data");
  ASSERT_FALSE(lock.has_value());
  EXPECT_EQ(lock.error().code, ErrorCode::kInternal);
  EXPECT_NE(lock.error().field.find("file/data"), std::string::npos);
}

}  // namespace
}  // namespace moondb
