#include "apps/moonctl/robot_pack.h"

#include <gmock/gmock.h>

#include "model/text.h"
#include "runtime/team/team_keys.h"
#include "tests/scoped_umask.h"
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

TEST_F(RobotPackTest, RefusesEachFlippedBit) {
  std::string bytes = SerializeRobotPack(PackOf("rover1", "--log-format json"));
  ASSERT_TRUE(ParseRobotPack(bytes));
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const char flip = static_cast<char>(1 << (bit % 8));
    bytes[bit / 8] ^= flip;
    EXPECT_FALSE(ParseRobotPack(bytes)) << "bit " << bit % 8 << " of byte " << bit / 8;
    bytes[bit / 8] ^= flip;
  }
}

// An attacker who forges a pack also computes its hash.
TEST_F(RobotPackTest, ParsesForgedPacksWithoutHarm) {
  std::string message = PackOf("rover1", "--log-format json").SerializeAsString();
  for (std::size_t bit = 0; bit < 8 * message.size(); bit += 41) {  // Every bit would take a minute.
    const char flip = static_cast<char>(1 << (bit % 8));
    message[bit / 8] ^= flip;
    proto::RobotPack forged;
    if (forged.ParseFromString(message)) {
      const auto parsed = ParseRobotPack(SerializeRobotPack(forged));
      EXPECT_EQ(parsed || !parsed.error().text.empty(), true);
    }
    message[bit / 8] ^= flip;
  }
}

TEST_F(RobotPackTest, RefusesEachTruncationAndEachByteTooMany) {
  const std::string bytes = SerializeRobotPack(PackOf("rover1"));
  for (std::size_t size = 0; size < bytes.size(); ++size) EXPECT_FALSE(ParseRobotPack(bytes.substr(0, size))) << size;
  EXPECT_FALSE(ParseRobotPack(bytes + '\0'));
}

TEST_F(RobotPackTest, SaysThatAPackOfAnotherVersionHasToBeMadeAgain) {
  const std::string message = PackOf("rover1").SerializeAsString();
  for (const std::string first_line : {"moondb robot pack 1\n", "moondb robot pack 3\n"}) {
    const auto refused = ParseRobotPack(first_line + message);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
    EXPECT_THAT(refused.error().text, HasSubstr("another version of moondb; make it again with `moonctl config pack`"));
  }
}

TEST_F(RobotPackTest, HoldsOneLineOfOptionsAndNothingElseForTheService) {
  const std::string line = "AGENT_OPTIONS=--log-format json --listen tcp://[::]:7400\n";
  proto::RobotPack pack = PackOf("rover1", "--log-format json");
  FileIn(pack, "rover1.env").set_content(line);
  EXPECT_TRUE(ParseRobotPack(SerializeRobotPack(pack)));
  for (const std::string& text : {
           std::string("LD_PRELOAD=/tmp/own.so\n"),
           line + "LD_PRELOAD=/tmp/own.so\n",
           std::string("AGENT_OPTIONS=a\\\nLD_PRELOAD=/tmp/own.so\n"),
           std::string("AGENT_OPTIONS=a\rLD_PRELOAD=/tmp/own.so\n"),
           std::string("AGENT_OPTIONS='a\n"),
           std::string("AGENT_OPTIONS=a\0\n", 17),
           std::string("AGENT_OPTIONS=--log-format json"),
           std::string("# AGENT_OPTIONS=a\n"),
           std::string(),
       }) {
    FileIn(pack, "rover1.env").set_content(text);
    EXPECT_THAT(ErrorOf(pack).text, HasSubstr("rover1.env: expected the one line AGENT_OPTIONS=")) << text;
  }
  const auto team = ReadTeamFile(ops_ / "team.yaml");
  ASSERT_TRUE(team);
  const auto refused = PackRobot(*team, ops_ / "team.yaml", "rover1", "--log-format json\nLD_PRELOAD=/tmp/own.so");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "--options");
}

TEST_F(RobotPackTest, HoldsKeysInKeyFiles) {
  for (const char* name : {"rover1.pub", "rover2.pub", "base.pub", "rover1.sec", "rover1.sign"}) {
    for (const std::string& text : {std::string(), std::string("#!/bin/sh\n"), std::string(40, '0') + "\nmore\n",
                                    std::string(20, '0') + std::string(20, '\0')}) {
      proto::RobotPack pack = PackOf("rover1");
      FileIn(pack, name).set_content(text);
      EXPECT_THAT(ErrorOf(pack).text, HasSubstr(std::string(name) + ": not a key")) << text;
    }
  }
  proto::RobotPack wrong_signing_key = PackOf("rover1");
  FileIn(wrong_signing_key, "rover1.sign").set_content(FileIn(wrong_signing_key, "rover1.sec").content());
  EXPECT_THAT(ErrorOf(wrong_signing_key).text, HasSubstr("rover1.sign: does not match the signing_key of rover1"));
  proto::RobotPack wrong_key = PackOf("rover1");
  FileIn(wrong_key, "rover1.sec").set_content(FileIn(wrong_key, "rover1.sign").content());
  EXPECT_THAT(ErrorOf(wrong_key).text, HasSubstr("rover1.sec: does not match the public key rover1.pub"));
}

TEST_F(RobotPackTest, HoldsAClientListAsClientList) {
  ASSERT_TRUE(WriteTextFile(ops_ / "clients.yaml", "clients: []\n"));
  proto::RobotPack pack = PackOf("rover1");
  ASSERT_TRUE(ParseRobotPack(SerializeRobotPack(pack)));
  FileIn(pack, "clients.yaml").set_content("#!/bin/sh\nrm -r /\n");
  EXPECT_FALSE(ParseRobotPack(SerializeRobotPack(pack)));
}

TEST_F(RobotPackTest, NamesKeyFilesPlainly) {
  for (const std::string name : {".profile", ".pub", "base.key", "base.pub.sh", "b$HOME.pub", "b ase.pub"}) {
    proto::RobotPack pack = PackOf("rover1");
    std::string& yaml = *FileIn(pack, "team.yaml").mutable_content();
    yaml.replace(yaml.find("base.pub"), 8, name);
    FileIn(pack, "base.pub").set_name(name);
    EXPECT_THAT(ErrorOf(pack).text, HasSubstr("end in .pub")) << name;
  }
}

TEST_F(RobotPackTest, IsUnpackedWithTheSameModesUnderEachUmask) {
  ASSERT_TRUE(WriteTextFile(ops_ / "clients.yaml", "clients: []\n"));
  const auto pack = PackOf("rover1", "--log-format json");
  for (const mode_t mask : {0000, 0022, 0077}) {
    const ScopedUmask umask(mask);
    const std::filesystem::path top = temporary_.path() / ("robot" + std::to_string(mask));
    ASSERT_TRUE(UnpackRobot(pack, top / "moondb"));
    EXPECT_EQ(ModeOf(top), 0755u) << mask;
    EXPECT_EQ(ModeOf(top / "moondb"), 0750u) << mask;
    for (const proto::PackedFile& file : pack.files()) {
      EXPECT_EQ(ModeOf(top / "moondb" / file.name()), file.is_secret() ? 0600u : 0644u) << file.name() << " " << mask;
    }
  }
}

TEST_F(RobotPackTest, IsUnpackedThroughNoPlantedLink) {
  ASSERT_TRUE(WriteTextFile(temporary_.File("victim"), "another's text"));
  std::filesystem::create_directory(robot_);
  const auto pack = PackOf("rover1");
  for (const proto::PackedFile& file : pack.files()) {
    std::filesystem::create_symlink(temporary_.path() / "victim", robot_ / (file.name() + ".new"));
  }
  std::filesystem::create_symlink(temporary_.path() / "victim", robot_ / "team.yaml");
  ASSERT_TRUE(UnpackRobot(pack, robot_));
  EXPECT_EQ(*ReadTextFile(temporary_.File("victim")), "another's text");
  EXPECT_FALSE(std::filesystem::is_symlink(robot_ / "team.yaml"));
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
  EXPECT_THAT(ErrorOf(outside).text, HasSubstr("does not belong to this pack"));
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
