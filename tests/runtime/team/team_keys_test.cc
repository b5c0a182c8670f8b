#include "runtime/team/team_keys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "runtime/team/team_config.h"
#include "tests/scoped_umask.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using ::testing::HasSubstr;

constexpr AgentId kRover1 = 1;
constexpr AgentId kRover2 = 2;

// A team of three agents as `moonctl config init` writes it, with all of its secrets.
class TeamKeysTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteInitialTeam(folder_ / "team.yaml", 3, 7400));
    team_ = ReadTeamFile(folder_ / "team.yaml").value().config;
  }

  Result<TeamKeys> Read(AgentId self) { return ReadTeamKeys(team_, folder_, self, secret_key_file_); }
  Result<std::optional<SigningKey>> ReadSigning(AgentId self) {
    return ReadSigningKey(team_, folder_, self, secret_key_file_);
  }

  void Move(const std::filesystem::path& from, const std::filesystem::path& to) {
    std::filesystem::create_directories((folder_ / to).parent_path());
    std::filesystem::rename(folder_ / from, folder_ / to);
  }

  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::filesystem::path secret_key_file_;  // Empty: the secret key lies beside the public key.
  proto::TeamConfig team_;
};

TEST_F(TeamKeysTest, AreAllPublicKeysAndTheAgentsOwnSecrets) {
  const Result<TeamKeys> keys = Read(kRover2);
  ASSERT_TRUE(keys) << ToString(keys.error());
  EXPECT_EQ(keys->public_keys.size(), 3u);
  EXPECT_EQ(keys->own.public_key, keys->public_keys.at(kRover2));
  EXPECT_EQ(PublicKeyOf(keys->own.secret_key).value(), keys->own.public_key);
  const auto signing = ReadSigning(kRover2);
  ASSERT_TRUE(signing) << ToString(signing.error());
  ASSERT_TRUE(signing->has_value());
  EXPECT_EQ((*signing)->public_key(), team_.agents(1).signing_key());
}

TEST_F(TeamKeysTest, AreWrittenWithTheSameModesUnderEachUmask) {
  for (const mode_t mask : {0000, 0022, 0077}) {
    const ScopedUmask umask(mask);
    const std::filesystem::path top = folder_ / ("team" + std::to_string(mask));
    ASSERT_TRUE(WriteInitialTeam(top / "mars" / "team.yaml", 3, 7400));
    EXPECT_EQ(ModeOf(top), 0755u) << mask;
    EXPECT_EQ(ModeOf(top / "mars"), 0755u) << mask;
    EXPECT_EQ(ModeOf(top / "mars" / "team.yaml"), 0644u) << mask;
    EXPECT_EQ(ModeOf(top / "mars" / "rover1.pub"), 0644u) << mask;
    EXPECT_EQ(ModeOf(top / "mars" / "rover1.sec"), 0600u) << mask;
    EXPECT_EQ(ModeOf(top / "mars" / "rover1.sign"), 0600u) << mask;
  }
}

TEST_F(TeamKeysTest, SecretsAreReadFromTheGivenPath) {
  Move("rover1.sec", "secrets/own.sec");
  Move("rover1.sign", "secrets/own.sign");
  EXPECT_FALSE(Read(kRover1));
  EXPECT_THAT(ReadSigning(kRover1).error().text, HasSubstr((folder_ / "rover1.sign").string() + ": "));
  secret_key_file_ = folder_ / "secrets" / "own.sec";
  EXPECT_TRUE(Read(kRover1));
  EXPECT_TRUE(ReadSigning(kRover1));
}

TEST_F(TeamKeysTest, SecretsOfAnotherAgentAreRefused) {
  Move("rover2.sec", "rover1.sec");
  Move("rover2.sign", "rover1.sign");
  EXPECT_THAT(Read(kRover1).error().text, HasSubstr("rover1.sec: does not fit the public key"));
  const auto signing = ReadSigning(kRover1);
  ASSERT_FALSE(signing);
  EXPECT_EQ(signing.error().code, ErrorCode::kInvalid);
  EXPECT_EQ(signing.error().text,
            (folder_ / "rover1.sign").string() + ": does not fit the signing_key of rover1 in the team file");
}

TEST_F(TeamKeysTest, SigningSecretsThatOthersCanReadAreRefused) {
  std::filesystem::permissions(folder_ / "rover1.sign", std::filesystem::perms(0640));
  EXPECT_THAT(ReadSigning(kRover1).error().text, HasSubstr("rover1.sign: others can read this secret"));
}

TEST_F(TeamKeysTest, ATeamWithoutKeysNeedsNoSigningSecret) {
  team_.set_insecure(true);
  std::filesystem::remove(folder_ / "rover1.sign");
  const auto signing = ReadSigning(kRover1);
  ASSERT_TRUE(signing) << ToString(signing.error());
  EXPECT_FALSE(signing->has_value());
}

}  // namespace
}  // namespace moondb
