// Commands must reach the right team and agent, even if two teams on one machine have the same name, team files differ,
// or agents were renamed.

#include <gmock/gmock.h>

#include "apps/common/data_folder.h"
#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr char kCold[] = "{\"celsius\": -40}";

class TeamIdentityTest : public ProcessTeam {
 protected:
  void TearDown() override {
    if (std::filesystem::exists(other_)) (void)Moonctl({"-t", other_, "down"});
    ProcessTeam::TearDown();
  }

  // Makes another team with the same name and the same agent names.
  void MakeOtherTeam() {
    MoonctlExpecting(0, {"config", "init", "--name", "moon", other_});
    AdaptToTest(other_, other_.parent_path());
  }

  void Edit(const std::filesystem::path& file, const std::string& from, const std::string& to) {
    std::string text = *ReadTextFile(file);
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
      text.replace(at, from.size(), to);
    }
    ASSERT_TRUE(WriteTextFile(file, text).has_value());
  }

  int TemperaturesOf(const std::filesystem::path& team, const std::string& agent) {
    const auto json = MoonctlJson(0, {"-t", team, "-a", agent, "record", "list", "temperature"});
    return json.fields().at("records").list_value().values_size();
  }

  const std::filesystem::path other_ = folder_ / "other" / "team.yaml";
};

TEST_F(TeamIdentityTest, TwoTeamsOfOneNameOnOneMachineDoNotMeet) {
  MakeOtherTeam();
  MoonctlExpecting(0, {"-a", "rover1", "up"});
  EXPECT_EQ(Moonctl({"-t", other_, "-a", "rover1", "status"}).exit_code, 3) << "it is not running";
  EXPECT_EQ(Moonctl({"-t", other_, "-a", "rover1", "record", "insert", "temperature", kCold}).exit_code, 3);
  EXPECT_EQ(TemperaturesOf(team_file_, "rover1"), 0);

  MoonctlExpecting(0, {"-t", other_, "-a", "rover1", "up"});
  MoonctlExpecting(0, {"-t", other_, "-a", "rover1", "record", "insert", "temperature", kCold});
  EXPECT_EQ(TemperaturesOf(team_file_, "rover1"), 0);
  EXPECT_EQ(TemperaturesOf(other_, "rover1"), 1);
  MoonctlExpecting(0, {"-a", "rover1", "down"});
  EXPECT_EQ(TemperaturesOf(other_, "rover1"), 1) << "it runs on";
}

TEST_F(TeamIdentityTest, AnAgentOfAnotherTeamReceivesNoRequests) {
  MoonctlExpecting(0, {"-a", "rover1", "up"});
  // The other team's id begins with the same characters, so its sockets have the same paths.
  const std::string id = ReadTeamFile(team_file_)->config.team_id();
  std::filesystem::create_directories(other_.parent_path());
  std::filesystem::copy(team_file_, other_);
  for (const char* name : {"rover1.pub", "rover2.pub", "rover3.pub", "base.pub"}) {
    std::filesystem::copy(folder_ / name, other_.parent_path() / name);
  }
  Edit(other_, id, id.substr(0, 31) + (id.back() == '0' ? '1' : '0'));
  for (const auto& words : std::vector<std::vector<std::string>>{
           {"-a", "rover1", "status"}, {"-a", "rover1", "record", "insert", "temperature", kCold}, {"health"}}) {
    std::vector<std::string> command = {"-t", other_};
    command.insert(command.end(), words.begin(), words.end());
    const Outcome refused = Moonctl(command);
    EXPECT_NE(refused.exit_code, 0);
    EXPECT_THAT(refused.out + refused.error, HasSubstr("belongs to another team: its team id is " + id.substr(0, 8)));
    if (words.size() > 1) {
      EXPECT_EQ(refused.exit_code, 4) << refused.out << refused.error;
    }
  }
  EXPECT_EQ(TemperaturesOf(team_file_, "rover1"), 0);
}

TEST_F(TeamIdentityTest, ARenamedAgentKeepsItsProcessAndItsData) {
  MoonctlExpecting(0, {"-a", "rover1", "up"});
  MoonctlExpecting(0, {"-a", "rover1", "record", "insert", "temperature", kCold});
  Edit(team_file_, "name: rover1", "name: scout");
  Edit(team_file_, "leader: rover1", "leader: scout");
  const pid_t pid = PidOf("rover1");
  const std::string up = MoonctlExpecting(0, {"-a", "scout", "up"});
  EXPECT_THAT(up, HasSubstr("was running"));
  EXPECT_THAT(up, HasSubstr("scout still runs under the name rover1; restart it to use the new name"));
  EXPECT_EQ(PidOf("rover1"), pid);
  EXPECT_EQ(TemperaturesOf(team_file_, "scout"), 1);

  MoonctlExpecting(0, {"-a", "scout", "down"});
  EXPECT_EQ(PidOf("rover1"), 0);
  const std::string again = MoonctlExpecting(0, {"-a", "scout", "up"});
  EXPECT_THAT(again, HasSubstr("scout keeps its data in " + (folder_ / "moondb-data" / "rover1").string()));
  EXPECT_GT(PidOf("rover1"), 0);
  EXPECT_EQ(TemperaturesOf(team_file_, "scout"), 1);
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "scout", "db", "query", "select celsius from temperature"}), HasSubstr("-40"));
  MoonctlExpecting(0, {"down"});
}

TEST_F(TeamIdentityTest, ReportsAgentsThatRunWithAnotherTeamFile) {
  MoonctlExpecting(0, {"up"});
  EXPECT_THAT(MoonctlExpecting(0, {"health"}), Not(HasSubstr("team file")));
  Edit(team_file_, "budget_kbps: 1000", "budget_kbps: 500");
  MoonctlExpecting(0, {"-a", "rover2", "down"});
  MoonctlExpecting(0, {"-a", "rover2", "up"});
  const Outcome status = Moonctl({"status"});
  EXPECT_EQ(status.exit_code, 0) << status.error;
  EXPECT_THAT(status.error, HasSubstr("moonctl: rover1 runs with another team file: hash "));
  EXPECT_THAT(status.error, HasSubstr("moonctl: base runs with another team file: hash "));
  EXPECT_THAT(status.error, Not(HasSubstr("rover2 runs")));
  const Outcome health = Moonctl({"health"});
  EXPECT_EQ(health.exit_code, 1);
  EXPECT_THAT(health.out, HasSubstr("runs with another team file: hash "));
  EXPECT_EQ(health.error.find("rover1 runs with"), health.error.rfind("rover1 runs with")) << "once a command";
  MoonctlExpecting(0, {"down"});
}

TEST_F(TeamIdentityTest, AddsAnIdToAFileAndChangesNothingElse) {
  const std::string id = ReadTeamFile(team_file_)->config.team_id();
  const std::string with = *ReadTextFile(team_file_);
  const std::size_t at = with.find("team_id:");
  std::string without = with;
  without.erase(at, with.find('\n', at) + 1 - at);
  ASSERT_TRUE(WriteTextFile(team_file_, without).has_value());
  std::filesystem::permissions(team_file_, std::filesystem::perms(0640));
  std::filesystem::create_symlink(team_file_, folder_ / "link.yaml");

  const std::string missing = "team_id: missing: `moonctl config check --fix` gives the file one";
  const Outcome refused = Moonctl({"status"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr(missing));
  const Outcome agent = StartAgent("rover1")->Wait();
  EXPECT_EQ(agent.exit_code, 2);
  EXPECT_THAT(agent.error, HasSubstr(missing));

  EXPECT_THAT(MoonctlExpecting(0, {"config", "check", "--fix", folder_ / "link.yaml"}),
              HasSubstr("copy the file to every"));
  const std::string fixed = *ReadTextFile(team_file_);
  const std::string new_id = ReadTeamFile(team_file_)->config.team_id();
  EXPECT_NE(new_id, id);
  std::string expected = with;
  expected.replace(expected.find(id), id.size(), new_id);
  EXPECT_EQ(fixed, expected);
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link.yaml"));
  EXPECT_EQ(std::filesystem::status(team_file_).permissions(), std::filesystem::perms(0640));

  EXPECT_THAT(MoonctlExpecting(0, {"config", "check", "--fix"}), HasSubstr("nothing to fix"));
  EXPECT_EQ(*ReadTextFile(team_file_), fixed);
  ASSERT_TRUE(WriteTextFile(team_file_, "team: [\n").has_value());
  EXPECT_EQ(Moonctl({"config", "check", "--fix"}).exit_code, 2);
  EXPECT_EQ(*ReadTextFile(team_file_), "team: [\n");
}

}  // namespace
}  // namespace moondb
