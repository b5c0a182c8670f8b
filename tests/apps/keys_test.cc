// Tests with real processes: keys of agents and clients, and agents that were removed from the team.

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>

#include <regex>

#include "model/text.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_keys.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class KeysProcessTest : public ProcessTeam {
 protected:
  static mode_t ModeOf(const std::filesystem::path& path) {
    struct stat status {};
    EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
    return status.st_mode & 0777;
  }

  // Replaces `what` by `text` in the team file. Requires: the file contains `what`.
  void Edit(const std::string& what, const std::string& text) {
    std::string yaml = *ReadTextFile(team_file_);
    const std::size_t at = yaml.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    ASSERT_TRUE(WriteTextFile(team_file_, yaml.replace(at, what.size(), text)).has_value());
  }

  std::string ErrorOf(int exit_code, std::vector<std::string> arguments) {
    const Outcome outcome = Moonctl(std::move(arguments));
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.out << outcome.error;
    return outcome.error;
  }

  // Removes the agents' signing keys, as in a team file written by hand.
  void ForgetSigningKeys() {
    const std::string yaml = *ReadTextFile(team_file_);
    const std::string without = std::regex_replace(yaml, std::regex("    signing_key: [^\n]*\n"), "");
    ASSERT_NE(without, yaml);
    ASSERT_TRUE(WriteTextFile(team_file_, without).has_value());
    for (const char* name : {"rover1", "rover2", "rover3", "base"}) {
      std::filesystem::remove(folder_ / (std::string(name) + ".sign"));
    }
  }
};

TEST_F(KeysProcessTest, ShowsTeamFileLinesThatMatchAnAgentsKeys) {
  const auto made = MoonctlJson(0, {"keys", "new", "rover4"});
  EXPECT_EQ(ModeOf(folder_ / "rover4.pub"), 0644u);
  EXPECT_EQ(ModeOf(folder_ / "rover4.sec"), 0600u);
  EXPECT_EQ(ModeOf(folder_ / "rover4.sign"), 0600u);
  const std::string signing_key = made.fields().at("signing_key").string_value();
  Edit("\n# Initial leader", "  - {id: 9, name: rover4, address: \"ipc://" + (folder_ / "p9").string() +
                                 "\", key: \"rover4.pub\", signing_key: \"" + signing_key + "\"}\n\n# Initial leader");
  const Result<TeamFile> team = ReadTeamFile(team_file_);
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_TRUE(ReadTeamKeys(team->config, team->folder, 9, ""));
  EXPECT_TRUE(ReadSigningKey(team->config, team->folder, 9, ""));
  const std::string secret = *ReadTextFile(folder_ / "rover4.sec");
  EXPECT_THAT(ErrorOf(4, {"keys", "new", "rover4"}), HasSubstr("exists already"));
  EXPECT_EQ(*ReadTextFile(folder_ / "rover4.sec"), secret);
  EXPECT_THAT(ErrorOf(2, {"keys", "new", "../x"}), HasSubstr("expected at most 32 lower-case"));
  environment_.erase("MOONDB_TEAM");
  EXPECT_THAT(ErrorOf(2, {"keys", "new", "rover5"}), HasSubstr("--out FOLDER"));
}

TEST_F(KeysProcessTest, OnlyTheUserMayReadAClientsSecret) {
  EXPECT_THAT(MoonctlExpecting(0, {"keys", "new", "anna", "--client"}), HasSubstr("moonctl clients add anna"));
  const std::filesystem::path own = folder_ / "config" / "moondb";
  EXPECT_EQ(ModeOf(own), 0700u);
  EXPECT_EQ(ModeOf(own / "anna.sec"), 0600u);
  EXPECT_FALSE(std::filesystem::exists(own / "anna.sign"));
  MoonctlExpecting(0, {"clients", "add", "anna", "--rights", "view", "--public-key", own / "anna.pub"});
  EXPECT_THAT(MoonctlExpecting(0, {"keys", "show"}), HasSubstr((own / "anna.sec").string()));
  std::filesystem::permissions(own, std::filesystem::perms(0755));
  EXPECT_THAT(ErrorOf(2, {"keys", "new", "bob", "--client"}), HasSubstr("mode 0700"));
  environment_["XDG_CONFIG_HOME"] = "relative";
  environment_["HOME"] = "";
  EXPECT_THAT(ErrorOf(2, {"keys", "new", "bob", "--client"}), HasSubstr("neither XDG_CONFIG_HOME nor HOME"));
}

TEST_F(KeysProcessTest, ShowsPresentSecretsAndThoseThatDoNotMatch) {
  std::filesystem::remove(folder_ / "rover2.sec");
  std::filesystem::remove(folder_ / "rover2.sign");
  const std::string shown = MoonctlExpecting(0, {"keys", "show"});
  EXPECT_THAT(shown, AllOf(HasSubstr("rover1.sec, rover1.sign"), Not(HasSubstr("rover2.sec"))));
  for (const char* secret : {"rover1.sec", "rover1.sign"}) {
    EXPECT_THAT(shown, Not(HasSubstr(ReadTextFile(folder_ / secret)->substr(0, 40)))) << "no secret is shown";
  }
  std::filesystem::copy(folder_ / "rover3.sec", folder_ / "rover2.sec");
  std::filesystem::permissions(folder_ / "base.sign", std::filesystem::perms(0644));
  EXPECT_THAT(MoonctlExpecting(1, {"keys", "show"}),
              AllOf(HasSubstr("rover2.sec: does not match the public key"), HasSubstr("run chmod 600 on it")));
}

TEST_F(KeysProcessTest, SigningKeysAreAddedToAFileThatHasNone) {
  ForgetSigningKeys();
  Edit("agents:", "agents:   # Our own words.");
  EXPECT_THAT(ErrorOf(2, {"config", "check"}), HasSubstr("moonctl keys add-signing"));
  const std::string before = *ReadTextFile(team_file_);
  ASSERT_TRUE(WriteTextFile(folder_ / "rover3.sign", "precious").has_value());
  EXPECT_THAT(ErrorOf(4, {"keys", "add-signing"}), HasSubstr("rover3.sign: exists already"));
  EXPECT_EQ(*ReadTextFile(team_file_), before);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "rover1.sign")) << "all or nothing";
  std::filesystem::remove(folder_ / "rover3.sign");

  EXPECT_THAT(MoonctlExpecting(0, {"keys", "add-signing"}), HasSubstr("signing keys for rover1, rover2, rover3, base"));
  const std::string after = *ReadTextFile(team_file_);
  EXPECT_EQ(std::regex_replace(after, std::regex("    signing_key: [^\n]*\n"), ""), before);
  EXPECT_EQ(ModeOf(folder_ / "rover1.sign"), 0600u);
  MoonctlExpecting(0, {"config", "check"});
  MoonctlExpecting(0, {"up", "-a", "rover1"});
  EXPECT_THAT(MoonctlExpecting(0, {"keys", "add-signing"}), HasSubstr("nothing to add"));
  EXPECT_EQ(*ReadTextFile(team_file_), after);
}

TEST_F(KeysProcessTest, SigningKeysAreNotAddedToAFileThatIsWrongOtherwise) {
  ForgetSigningKeys();
  Edit("budget_kbps", "budget_kpbs");
  EXPECT_THAT(ErrorOf(2, {"keys", "add-signing"}), HasSubstr("did you mean \"budget_kbps\"?"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "rover1.sign"));
}

TEST_F(KeysProcessTest, ARemovedAgentIsNotStartedNotMissedAndNotObeyed) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"role", "set", "rover1", "leader", "rover3", "survivor", "-a", "base"});
  MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -40}", "-a", "rover2"});
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"down"});
  Edit("    name: rover2\n", "    name: rover2\n    left: true\n");
  EXPECT_THAT(ErrorOf(2, {"config", "check"}), HasSubstr("roles.survivor: rover2 has left the team"));
  Edit("survivor: rover2", "survivor: rover3");

  EXPECT_THAT(MoonctlExpecting(0, {"up"}), HasSubstr("has left the team"));
  EXPECT_EQ(PidOf("rover2"), 0);
  ASSERT_TRUE(Until([&] { return Moonctl({"health"}).exit_code == 0; })) << Moonctl({"health"}).out;
  EXPECT_THAT(MoonctlExpecting(0, {"status"}), AllOf(HasSubstr("has left the team"), HasSubstr("2/2")));
  EXPECT_THAT(MoonctlExpecting(0, {"role", "show"}), Not(HasSubstr("rover2")));
  EXPECT_THAT(MoonctlExpecting(0, {"record", "list", "temperature", "-a", "rover1", "--origin", "rover2"}),
              HasSubstr("temperature"))
      << "its records stay";
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"status", "-a", "rover2"}, {"role", "set", "rover2", "leader"}, {"sync", "now", "--from", "rover2"}}) {
    EXPECT_THAT(ErrorOf(4, words), HasSubstr("rover2 has left team moon")) << words.front();
  }
  const auto child = StartAgent("rover2");
  const Outcome refused = child->Wait();
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.error, HasSubstr("rover2 has left team moon (left: true in the team file)"));
}

}  // namespace
}  // namespace moondb
