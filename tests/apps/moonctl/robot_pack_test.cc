#include "apps/moonctl/robot_pack.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "model/text.h"
#include "runtime/team/team_keys.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RobotPackTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(WriteInitialTeam(ops_ / "team.yaml", 3, 7400)); }

  proto::RobotPack PackOf(const std::string& agent, const std::string& options = "") {
    const auto team = ReadTeamFile(ops_ / "team.yaml");
    EXPECT_TRUE(team);
    auto pack = PackRobot(*team, ops_ / "team.yaml", agent, options);
    EXPECT_TRUE(pack) << pack.error().text;
    return *std::move(pack);
  }

  static std::vector<std::string> NamesIn(const proto::RobotPack& pack) {
    std::vector<std::string> names;
    for (const proto::PackedFile& file : pack.files()) names.push_back(file.name());
    return names;
  }

  static Error ErrorOf(const proto::RobotPack& pack) {
    const auto parsed = ParseRobotPack(SerializeRobotPack(pack));
    EXPECT_FALSE(parsed);
    return parsed ? Error() : parsed.error();
  }

  static proto::PackedFile& FileIn(proto::RobotPack& pack, const std::string& name) {
    for (proto::PackedFile& file : *pack.mutable_files()) {
      if (file.name() == name) return file;
    }
    ADD_FAILURE() << name;
    return *pack.mutable_files(0);
  }

  static mode_t ModeOf(const std::filesystem::path& path) {
    struct stat status {};
    EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
    return status.st_mode & 0777;
  }

  TemporaryFolder temporary_;
  std::filesystem::path ops_ = temporary_.path() / "ops";
  std::filesystem::path robot_ = temporary_.path() / "robot";
};

TEST_F(RobotPackTest, HoldsAllFilesOfOneAgentAndNoSecretOfAnother) {
  EXPECT_THAT(NamesIn(PackOf("rover1")),
              ElementsAre("team.yaml", "rover1.pub", "rover1.sec", "rover1.sign", "rover2.pub", "base.pub"));
  ASSERT_TRUE(WriteTextFile(ops_ / "clients.yaml", "clients: []\n"));
  EXPECT_THAT(NamesIn(PackOf("base", "--log-format json")),
              ElementsAre("team.yaml", "clients.yaml", "base.env", "rover1.pub", "rover2.pub", "base.pub", "base.sec",
                          "base.sign"));
}

TEST_F(RobotPackTest, NeedsTheSecretsOfItsAgent) {
  std::filesystem::remove(ops_ / "rover1.sign");
  const auto team = ReadTeamFile(ops_ / "team.yaml");
  ASSERT_TRUE(team);
  EXPECT_THAT(PackRobot(*team, ops_ / "team.yaml", "rover1", "").error().text, HasSubstr("rover1.sign"));
  std::filesystem::copy_file(ops_ / "base.sec", ops_ / "rover2.sec", std::filesystem::copy_options::overwrite_existing);
  EXPECT_FALSE(PackRobot(*team, ops_ / "team.yaml", "rover2", ""));
}

TEST_F(RobotPackTest, IsUnpackedWithSecretsForTheUserAlone) {
  const auto pack = ParseRobotPack(SerializeRobotPack(PackOf("rover1", "--log-format json")));
  ASSERT_TRUE(pack) << pack.error().text;
  const auto changed = UnpackRobot(*pack, robot_);
  ASSERT_TRUE(changed) << changed.error().text;
  EXPECT_EQ(changed->size(), 7u);
  EXPECT_EQ(changed->back(), "team.yaml");
  EXPECT_EQ(ModeOf(robot_ / "rover1.sec"), 0600u);
  EXPECT_EQ(ModeOf(robot_ / "rover1.sign"), 0600u);
  EXPECT_EQ(ModeOf(robot_ / "rover1.pub"), 0644u);
  EXPECT_EQ(*ReadTextFile(robot_ / "rover1.env"), "AGENT_OPTIONS=--log-format json\n");
  const auto team = ReadTeamFile(robot_ / "team.yaml");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_TRUE(ReadTeamKeys(team->config, robot_, 1, ""));
  EXPECT_TRUE(ReadSigningKey(team->config, robot_, 1, ""));
  EXPECT_THAT(*UnpackRobot(*pack, robot_), IsEmpty());
}

TEST_F(RobotPackTest, ReplacesAnOlderTeamFileButNoOtherSecret) {
  ASSERT_TRUE(UnpackRobot(PackOf("rover1"), robot_));
  ASSERT_TRUE(WriteTextFile(robot_ / "team.yaml", "old"));
  EXPECT_THAT(*UnpackRobot(PackOf("rover1"), robot_), ElementsAre("team.yaml"));
  EXPECT_EQ(*ReadTextFile(robot_ / "team.yaml"), *ReadTextFile(ops_ / "team.yaml"));

  ASSERT_TRUE(WriteTextFile(robot_ / "team.yaml", "old"));
  ASSERT_TRUE(WriteTextFile(robot_ / "rover1.sign", "another"));
  const auto refused = UnpackRobot(PackOf("rover1"), robot_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(*ReadTextFile(robot_ / "team.yaml"), "old");
}

TEST_F(RobotPackTest, RefusesBytesThatAreNoPackOfThisTeam) {
  EXPECT_EQ(ParseRobotPack("team: x\n").error().code, ErrorCode::kCorrupt);
  const std::string bytes = SerializeRobotPack(PackOf("rover1"));
  EXPECT_EQ(ParseRobotPack(bytes.substr(0, bytes.size() / 2)).error().code, ErrorCode::kCorrupt);

  proto::RobotPack other_agent = PackOf("rover1");
  other_agent.set_agent("rover7");
  EXPECT_THAT(ErrorOf(other_agent).text, HasSubstr("has no agent rover7"));
  proto::RobotPack outside = PackOf("rover1");
  outside.add_files()->set_name("../../etc/passwd");
  EXPECT_THAT(ErrorOf(outside).text, HasSubstr("does not belong into this pack"));
  proto::RobotPack readable = PackOf("rover1");
  FileIn(readable, "rover1.sec").set_is_secret(false);
  EXPECT_THAT(ErrorOf(readable).text, HasSubstr("rover1.sec does not belong"));
  proto::RobotPack twice = PackOf("rover1");
  *twice.add_files() = FileIn(twice, "rover1.pub");
  EXPECT_THAT(ErrorOf(twice).text, HasSubstr("rover1.pub does not belong"));
  proto::RobotPack lacking = PackOf("rover1");
  lacking.mutable_files()->RemoveLast();
  EXPECT_THAT(ErrorOf(lacking).text, HasSubstr("lacks the file base.pub"));
  proto::RobotPack bad_team = PackOf("rover1");
  FileIn(bad_team, "team.yaml").set_content("team: [");
  EXPECT_EQ(ErrorOf(bad_team).code, ErrorCode::kInvalid);
  proto::RobotPack key_elsewhere = PackOf("rover1");
  std::string& yaml = *FileIn(key_elsewhere, "team.yaml").mutable_content();
  yaml.replace(yaml.find("base.pub"), 8, "../b.pub");
  EXPECT_THAT(ErrorOf(key_elsewhere).text, HasSubstr("beside the team file"));
}

}  // namespace
}  // namespace moondb
