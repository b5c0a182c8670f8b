#include "model/file_writing.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <cerrno>

#include "model/text.h"
#include "tests/scoped_umask.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

class FileWritingTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteTextFile(victim_, "another's text"));
    ASSERT_EQ(::chmod(victim_.c_str(), 0600), 0);
  }

  // Plants a link to `victim_`, as another user could who may write to the folder.
  void PlantLink(const std::string& name) { std::filesystem::create_symlink(victim_, folder_.File(name)); }

  void ExpectVictimUnchanged() {
    EXPECT_EQ(*ReadTextFile(victim_), "another's text");
    EXPECT_EQ(ModeOf(victim_), 0600u);
  }

  bool IsFile(const std::string& name) {
    return std::filesystem::is_regular_file(std::filesystem::symlink_status(folder_.File(name)));
  }

  TemporaryFolder folder_;
  std::filesystem::path victim_ = folder_.path() / "victim";
};

TEST_F(FileWritingTest, FollowsNoLinkAtTheTemporaryName) {
  PlantLink("list.part");
  ASSERT_TRUE(WriteTextFile(folder_.File("list"), "mine"));
  ExpectVictimUnchanged();
  EXPECT_TRUE(IsFile("list"));
  EXPECT_EQ(*ReadTextFile(folder_.File("list")), "mine");
}

TEST_F(FileWritingTest, ReplacesALinkAtTheFilesOwnName) {
  PlantLink("list");
  ASSERT_TRUE(WriteWholeFile(folder_.File("list"), "mine", {.mode = 0644}));
  ExpectVictimUnchanged();
  EXPECT_TRUE(IsFile("list"));
}

TEST_F(FileWritingTest, DoesNotOpenAnExistingFileAtTheTemporaryName) {
  ASSERT_TRUE(WriteTextFile(folder_.File("list.part"), "left by a killed process"));
  ASSERT_EQ(::chmod(folder_.File("list.part").c_str(), 0666), 0);
  std::filesystem::create_hard_link(folder_.File("list.part"), folder_.File("another_name"));
  ASSERT_TRUE(WriteTextFile(folder_.File("list"), "mine"));
  EXPECT_EQ(*ReadTextFile(folder_.File("another_name")), "left by a killed process");
  EXPECT_EQ(ModeOf(folder_.File("list")) & 0022, 0u);
}

TEST_F(FileWritingTest, CreatesNoFileWhereAnythingExists) {
  PlantLink("list");
  EXPECT_EQ(WriteNew(folder_.File("list"), "mine", {}).value(), EEXIST);
  std::filesystem::create_symlink(folder_.File("nowhere"), folder_.File("dangling"));
  EXPECT_EQ(WriteNew(folder_.File("dangling"), "mine", {}).value(), EEXIST);
  EXPECT_FALSE(std::filesystem::exists(folder_.File("nowhere")));
  std::filesystem::create_directory(folder_.File("folder"));
  EXPECT_TRUE(WriteTemporary(folder_.File("folder"), "mine", {}));
  ExpectVictimUnchanged();
}

TEST_F(FileWritingTest, MovesAFileOnlyToANewName) {
  const auto from = folder_.File("from");
  ASSERT_TRUE(WriteTextFile(from, "text"));
  EXPECT_EQ(MoveToNew(from, victim_).value(), EEXIST);
  ExpectVictimUnchanged();
  EXPECT_EQ(MoveToNew(from, folder_.File("none/to")).value(), ENOENT);
  EXPECT_FALSE(MoveToNew(from, folder_.File("to")));
  EXPECT_EQ(*ReadTextFile(folder_.File("to")), "text");
  EXPECT_FALSE(std::filesystem::exists(from));
}

TEST_F(FileWritingTest, GivesExactModesWhateverTheUmask) {
  for (const mode_t mask : {0000, 0022, 0077}) {
    const ScopedUmask umask(mask);
    ASSERT_TRUE(WriteWholeFile(folder_.File("list"), "mine", {.mode = 0644}));
    EXPECT_EQ(ModeOf(folder_.File("list")), 0644u) << mask;
    ASSERT_TRUE(WriteWholeFile(folder_.File("secret"), "mine", {.mode = 0600}));
    EXPECT_EQ(ModeOf(folder_.File("secret")), 0600u) << mask;
    const std::filesystem::path top = folder_.path() / ("top" + std::to_string(mask));
    ASSERT_FALSE(MakeFolders(top / "below", 0755));
    EXPECT_EQ(ModeOf(top), 0755u) << mask;
    EXPECT_EQ(ModeOf(top / "below"), 0755u) << mask;
  }
}

TEST_F(FileWritingTest, LetsTheUmaskOnlyTakeRightsFromExportedFiles) {
  const std::pair<mode_t, mode_t> expected[] = {{0000, 0755}, {0022, 0755}, {0027, 0750}, {0077, 0700}};
  for (const auto& [mask, mode] : expected) {
    const ScopedUmask umask(mask);
    ASSERT_TRUE(WriteTextFile(folder_.File("map"), "mine"));
    EXPECT_EQ(ModeOf(folder_.File("map")), mode & 0666) << mask;
    const std::filesystem::path top = folder_.path() / ("top" + std::to_string(mask));
    ASSERT_FALSE(MakeFolders(top / "below"));
    EXPECT_EQ(ModeOf(top / "below"), mode) << mask;
  }
}

TEST_F(FileWritingTest, LeavesExistingFoldersAsTheyAre) {
  ASSERT_FALSE(MakeFolders(folder_.path() / "made", 0700));
  ASSERT_FALSE(MakeFolders(folder_.path() / "made" / "below", 0755));
  EXPECT_EQ(ModeOf(folder_.path() / "made"), 0700u);
  EXPECT_EQ(MakeFolders(victim_ / "below").value(), ENOTDIR);
  EXPECT_FALSE(MakeFolders(""));
}

TEST_F(FileWritingTest, ChangesTheModeOfNoFolderBehindALink) {
  ASSERT_FALSE(MakeFolders(folder_.path() / "made", 0755));
  std::filesystem::create_symlink("made", folder_.File("link"));
  EXPECT_TRUE(SetFolderMode(folder_.File("link"), 0700));
  EXPECT_EQ(ModeOf(folder_.path() / "made"), 0755u);
  EXPECT_FALSE(SetFolderMode(folder_.path() / "made", 0700));
  EXPECT_EQ(ModeOf(folder_.path() / "made"), 0700u);
}

TEST_F(FileWritingTest, RemovesAFileThatItCouldNotFinish) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{10, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Result<void> written = WriteTextFile(victim_, "a text that is longer than the limit of ten bytes");
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  ::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().field, victim_.string());
  ExpectVictimUnchanged();
  EXPECT_FALSE(std::filesystem::exists(victim_.string() + ".part"));
}

}  // namespace
}  // namespace moondb
