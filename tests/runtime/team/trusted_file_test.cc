#include "runtime/team/trusted_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "runtime/team/client_list.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/team_config.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class TrustedFileTest : public testing::Test {
 protected:
  std::string Make(const std::string& name, mode_t mode) {
    const std::string path = folder_.File(name);
    std::ofstream(path) << "text";
    EXPECT_EQ(::chmod(path.c_str(), mode), 0);
    return path;
  }

  TemporaryFolder folder_;
};

TEST_F(TrustedFileTest, MayOnlyBeWritableByItsUser) {
  EXPECT_TRUE(CheckTrusted(Make("a", 0644)));
  EXPECT_TRUE(CheckTrusted(Make("b", 0664))) << "this process's own group";
  EXPECT_TRUE(CheckTrusted(folder_.File("missing")));
  const auto refused = CheckTrusted(Make("c", 0646));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(ToString(refused.error()), HasSubstr("chmod go-w"));
}

TEST_F(TrustedFileTest, MayNotBeWritableByAnotherGroup) {
  const std::string path = Make("a", 0664);
  if (::geteuid() != 0) GTEST_SKIP() << "only root gives files away";
  ASSERT_EQ(::chown(path.c_str(), ::geteuid(), ::getegid() + 1), 0);
  EXPECT_FALSE(CheckTrusted(path));
}

// Another user who may write to the folder could replace the file in it.
TEST_F(TrustedFileTest, MayNotLieInAFolderThatOthersMayWrite) {
  const std::string path = Make("a", 0644);
  for (const mode_t mode : {0777, 0757, 0702}) {
    ASSERT_EQ(::chmod(folder_.path().c_str(), mode), 0);
    const auto refused = CheckTrusted(path);
    ASSERT_FALSE(refused) << mode;
    EXPECT_THAT(ToString(refused.error()), HasSubstr("could replace it"));
    EXPECT_THAT(ToString(refused.error()), HasSubstr("chmod go-w " + folder_.path().string()));
  }
  ASSERT_EQ(::chmod(folder_.path().c_str(), 0777), 0);
  for (const auto& error : {ReadTeamFile(path).error(), ReadClientList(path).error(), ReadPublicKey(path).error()}) {
    EXPECT_THAT(ToString(error), HasSubstr("could replace it"));
  }
}

TEST_F(TrustedFileTest, MayLieInAFolderOfItsUserOrInAStickyOne) {
  const std::string path = Make("a", 0644);
  for (const mode_t mode : {0700, 0755, 0775, 01777, 01757}) {
    ASSERT_EQ(::chmod(folder_.path().c_str(), mode), 0);
    EXPECT_TRUE(CheckTrusted(path)) << mode;
  }
  if (::geteuid() != 0) GTEST_SKIP() << "only root gives folders away";
  ASSERT_EQ(::chown(folder_.path().c_str(), ::geteuid(), ::getegid() + 1), 0);
  ASSERT_EQ(::chmod(folder_.path().c_str(), 0775), 0);
  EXPECT_FALSE(CheckTrusted(path)) << "another group may write";
}

TEST_F(TrustedFileTest, MayNotLieBehindALinkInAFolderThatOthersMayWrite) {
  const std::filesystem::path shared = folder_.path() / "shared";
  std::filesystem::create_directory(shared);
  std::ofstream(shared / "a") << "text";
  std::filesystem::create_symlink("shared/a", folder_.path() / "link");
  EXPECT_TRUE(CheckTrusted(folder_.path() / "link"));
  ASSERT_EQ(::chmod(shared.c_str(), 0777), 0);
  EXPECT_FALSE(CheckTrusted(folder_.path() / "link"));
}

TEST_F(TrustedFileTest, MayLieInASharedFolderOnlyIfItIsSticky) {
  EXPECT_EQ(::chmod(folder_.path().c_str(), 0777), 0);
  EXPECT_FALSE(CheckTrusted(folder_.path()));
  EXPECT_EQ(::chmod(folder_.path().c_str(), 01777), 0);
  EXPECT_TRUE(CheckTrusted(folder_.path())) << "others remove nothing there";
}

// A user who can write a team file, client list or public key could change it in the operator's name.
TEST_F(TrustedFileTest, IsRequiredForTeamFilesClientListsAndPublicKeys) {
  const std::string path = Make("a", 0666);
  EXPECT_THAT(ToString(ReadTeamFile(path).error()), HasSubstr("other users may write it"));
  EXPECT_THAT(ToString(ReadClientList(path).error()), HasSubstr("other users may write it"));
  EXPECT_THAT(ToString(ReadPublicKey(path).error()), HasSubstr("other users may write it"));
}

}  // namespace
}  // namespace moondb
