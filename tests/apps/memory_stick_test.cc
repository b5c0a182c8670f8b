// Tests that packs and backups can be written to file systems without hard links, such as FAT on memory sticks.

#include <gmock/gmock.h>

#include <set>

#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class MemoryStickTest : public ProcessTeam {
 protected:
  void SetUp() override {
#ifndef MOONDB_MEMORY_STICK_LIBRARY
    GTEST_SKIP() << "a build with a sanitizer preloads no library";
#else
    ASSERT_NO_FATAL_FAILURE(ProcessTeam::SetUp());
    MoonctlExpecting(0, {"-a", "rover2", "up"});
    std::filesystem::create_directory(stick_);
    environment_["LD_PRELOAD"] = MOONDB_MEMORY_STICK_LIBRARY;
    environment_["MOONDB_MEMORY_STICK"] = stick_;
#endif
  }

  std::set<std::string> NamesOnStick() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(stick_)) names.insert(entry.path().filename());
    return names;
  }

  const std::filesystem::path stick_ = folder_ / "stick";
};

TEST_F(MemoryStickTest, BackupsAndPacksNeedNoHardLinks) {
  MoonctlExpecting(0, {"-a", "rover2", "db", "backup", stick_ / "rover2.sqlite"});
  MoonctlExpecting(0, {"config", "pack", "rover2", stick_ / "rover2.pack"});
  EXPECT_THAT(NamesOnStick(), ElementsAre("rover2.pack", "rover2.sqlite"));
  EXPECT_GT(std::filesystem::file_size(stick_ / "rover2.sqlite"), 0u);
  // Existing files are not replaced.
  const auto size = std::filesystem::file_size(stick_ / "rover2.sqlite");
  MoonctlExpecting(2, {"-a", "rover2", "db", "backup", stick_ / "rover2.sqlite"});
  EXPECT_EQ(std::filesystem::file_size(stick_ / "rover2.sqlite"), size);
  MoonctlExpecting(0, {"config", "unpack", stick_ / "rover2.pack", stick_ / "robot"});
  EXPECT_TRUE(std::filesystem::exists(stick_ / "robot" / "team.yaml"));
  MoonctlExpecting(0, {"config", "init", "--agents", "2", stick_ / "team" / "team.yaml"});
  EXPECT_TRUE(std::filesystem::exists(stick_ / "team" / "rover1.sec"));
}

TEST_F(MemoryStickTest, SecretsThatNobodyCanHideAreRefusedWithTheReason) {
  MoonctlExpecting(0, {"config", "pack", "rover2", stick_ / "rover2.pack"});
  MoonctlExpecting(0, {"config", "unpack", stick_ / "rover2.pack", stick_ / "robot"});
  // On a stick, files have the permissions of the mount.
  using std::filesystem::perms;
  std::filesystem::permissions(stick_ / "robot" / "rover2.sec",
                               perms::owner_all | perms::group_read | perms::others_read);
  const Outcome outcome = Moonctl({"-t", stick_ / "robot" / "team.yaml", "doctor", "-a", "rover2"});
  EXPECT_THAT(outcome.out,
              HasSubstr("rover2.sec: others can read this secret; its file system (FAT or similar) hides no "
                        "file: use a disk with permissions, such as ext4"));
}

}  // namespace
}  // namespace moondb
