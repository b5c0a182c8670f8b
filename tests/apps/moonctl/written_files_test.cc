#include "apps/moonctl/written_files.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include "model/text.h"
#include "tests/scoped_umask.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class WrittenFilesTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteTextFile(victim_, "another's text"));
    ASSERT_EQ(::chmod(victim_.c_str(), 0600), 0);
    ASSERT_TRUE(WriteTextFile(file_, "old"));
    ASSERT_EQ(::chmod(file_.c_str(), 0640), 0);
  }

  void ExpectVictimUnchanged() {
    EXPECT_EQ(*ReadTextFile(victim_), "another's text");
    EXPECT_EQ(ModeOf(victim_), 0600u);
  }

  TemporaryFolder folder_;
  std::filesystem::path victim_ = folder_.path() / "victim";
  std::filesystem::path file_ = folder_.path() / "team.yaml";
};

TEST_F(WrittenFilesTest, ReplacingAFileFollowsNoPlantedLink) {
  for (const char* name : {"team.yaml.new", "team.yaml.part", "team.yaml.new.part"}) {
    std::filesystem::create_symlink(victim_, folder_.path() / name);
  }
  ASSERT_TRUE(ReplaceFile(file_, "new"));
  ExpectVictimUnchanged();
  EXPECT_EQ(*ReadTextFile(file_), "new");
  EXPECT_EQ(ModeOf(file_), 0640u);
}

TEST_F(WrittenFilesTest, WritingTogetherFollowsNoPlantedLink) {
  for (const char* name : {"map.png.new", "map.png.new.part", "map.png"}) {
    std::filesystem::create_symlink(victim_, folder_.path() / name);
  }
  ASSERT_TRUE(WriteTogether(folder_.path(), {{folder_.path() / "map.png", "picture"}}));
  ExpectVictimUnchanged();
  EXPECT_EQ(*ReadTextFile(folder_.path() / "map.png"), "picture");
}

TEST_F(WrittenFilesTest, MakesFoldersThatOnlyTheirOwnerMayWrite) {
  const ScopedUmask umask(0);
  ASSERT_TRUE(WriteTogether(folder_.path() / "a" / "b", {{folder_.path() / "a" / "b" / "map.png", "picture"}}));
  EXPECT_EQ(ModeOf(folder_.path() / "a"), 0755u);
  EXPECT_EQ(ModeOf(folder_.path() / "a" / "b"), 0755u);
  EXPECT_EQ(ModeOf(folder_.path() / "a" / "b" / "map.png"), 0644u);
}

TEST_F(WrittenFilesTest, ReplacesTheFileBehindALinkOfThisUser) {
  std::filesystem::create_directory(folder_.path() / "links");
  std::filesystem::create_symlink("../team.yaml", folder_.path() / "links" / "first.yaml");
  std::filesystem::create_symlink(folder_.path() / "links" / "first.yaml", folder_.path() / "second.yaml");
  ASSERT_TRUE(ReplaceFile(folder_.path() / "second.yaml", "new"));
  EXPECT_EQ(*ReadTextFile(file_), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder_.path() / "second.yaml"));
}

TEST_F(WrittenFilesTest, RefusesALinkThatAnotherUserMade) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root gives links away";
  const std::filesystem::path link = folder_.path() / "link.yaml";
  std::filesystem::create_symlink(victim_, link);
  ASSERT_EQ(::lchown(link.c_str(), 12345, 12345), 0);
  const auto refused = ReplaceFile(link, "new");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_THAT(refused.error().text, HasSubstr("is a symbolic link of another user"));
  ExpectVictimUnchanged();
}

TEST_F(WrittenFilesTest, RefusesLinksThatLeadToEachOther) {
  std::filesystem::create_symlink("b", folder_.path() / "a");
  std::filesystem::create_symlink("a", folder_.path() / "b");
  EXPECT_FALSE(ReplaceFile(folder_.path() / "a", "new"));
  EXPECT_FALSE(ReplaceFile(folder_.path() / "missing", "new"));
}

TEST_F(WrittenFilesTest, AReplacedFileKeepsItsOwnerAndLosesTheRightOfAllToWrite) {
  ASSERT_EQ(::chmod(file_.c_str(), 0666), 0);
  const bool is_given = ::geteuid() == 0 && ::chown(file_.c_str(), 12345, 54321) == 0;
  ASSERT_TRUE(ReplaceFile(file_, "new"));
  EXPECT_EQ(ModeOf(file_), 0664u);
  struct stat status {};
  ASSERT_EQ(::stat(file_.c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, is_given ? 12345u : ::geteuid());
  EXPECT_EQ(status.st_gid, is_given ? 54321u : ::getegid());
}

}  // namespace
}  // namespace moondb
