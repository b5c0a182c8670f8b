// Tests a team whose agents run on separate machines. An operator works at one of the machines.

#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>

#include "apps/common/data_folder.h"
#include "client/endpoint.h"
#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using Words = std::vector<std::string>;

constexpr char kThroughRover2[] = "moonctl: requests are relayed by rover2, over the radio\n";
const std::vector<std::string> kNames = {"rover1", "rover2", "rover3", "base"};

// Each machine is a folder with the team file and with one agent's secret keys, data and sockets.
class FourMachinesTest : public ProcessTeam {
 protected:
  void SetUp() override {
    ProcessTeam::SetUp();
    environment_.clear();  // The operator has no MOONDB_RUN_DIR. StartOn sets one for each agent.
    LetCommandsComeThrough("base, rover2");
    for (const std::string& name : kNames) {
      std::filesystem::create_directories(MachineOf(name));
      for (const auto& file : std::filesystem::directory_iterator(folder_)) {
        const std::string file_name = file.path().filename();
        const bool is_for_all = file_name == "team.yaml" || file_name.ends_with(".pub");
        const bool is_own = file_name == name + ".sec" || file_name == name + ".sign";
        if (is_for_all || is_own) std::filesystem::copy(file, MachineOf(name));
      }
      StartOn(name);
    }
    for (const std::string& name : kNames) {
      ASSERT_TRUE(Until([&] {
        return At(name, {"-a", name, "status"}).out.find(" 3/3 ") != std::string::npos;
      })) << name;
    }
  }

  void TearDown() override {
    for (auto& [name, agent] : agents_) {
      agent->Signal(SIGCONT);
      agent->Signal(SIGTERM);
    }
    for (auto& [name, agent] : agents_) (void)agent->Wait();
  }

  // Sets command_from in the team file to `names`.
  void LetCommandsComeThrough(const std::string& names) {
    std::string yaml = *ReadTextFile(team_file_);
    const std::string line = "command_from: [base]";
    ASSERT_NE(yaml.find(line), std::string::npos);
    std::ofstream(team_file_) << yaml.replace(yaml.find(line), line.size(), "command_from: [" + names + "]");
  }

  std::filesystem::path MachineOf(const std::string& name) const { return folder_ / ("at-" + name); }
  std::filesystem::path DataOf(const std::string& name) const { return MachineOf(name) / "moondb-data" / name; }

  void StartOn(const std::string& name) {
    const Words command = {MOONDB_AGENT_PROGRAM, "--team", MachineOf(name) / "team.yaml", "--agent", name};
    agents_[name] = std::make_unique<Child>(
        command, std::map<std::string, std::string>{{"MOONDB_RUN_DIR", MachineOf(name) / "run"}}, MachineOf(name));
  }

  // Runs `moonctl` with `words` on the machine of the agent `name`.
  Outcome At(const std::string& name, Words words) {
    words.insert(words.begin(), {"-t", MachineOf(name) / "team.yaml"});
    return Moonctl(std::move(words));
  }
  Outcome AtRover2(int exit_code, const Words& words) {
    const Outcome outcome = At("rover2", words);
    std::string line;
    for (const std::string& word : words) line += " " + word;
    EXPECT_EQ(outcome.exit_code, exit_code) << "moonctl" << line << "\n" << outcome.out << outcome.error;
    return outcome;
  }

  void EndOn(const std::string& name) {
    agents_.at(name)->Signal(SIGKILL);
    (void)agents_.at(name)->Wait();
    agents_.erase(name);
    ASSERT_TRUE(Until([&] {
      const std::string status = At("rover2", {"-a", "rover2", "status"}).out;
      return status.find(" " + std::to_string(agents_.size() - 1) + "/3 ") != std::string::npos;
    }));
  }

  std::map<std::string, std::unique_ptr<Child>> agents_;
};

TEST_F(FourMachinesTest, CommandsOfTheReadmeWorkThroughOneAgentAndNameIt) {
  const Outcome inserted = AtRover2(0, {"-a", "rover3", "record", "insert", "temperature", "{\"celsius\": -40.5}"});
  EXPECT_THAT(inserted.out, HasSubstr("3."));
  EXPECT_EQ(inserted.error, kThroughRover2);
  const std::vector<std::pair<Words, std::string>> commands = {
      {{"role", "swap"}, "leader rover2, survivor rover1"},
      {{"-a", "rover1", "role", "set", "rover1", "leader", "rover2", "survivor"}, "leader rover1, survivor rover2"},
      {{"sync", "now", "--wait"}, "sync at rover1: all records are acknowledged"},
      {{"replicate", "now", "--wait"}, "replication at rover1: all records are acknowledged"},
      {{"-a", "rover1", "record", "list", "temperature"}, "3."},
      {{"status"}, "designated_survivor"},
      {{"health"}, "base    good"},
      {{"sync", "status"}, "rover3"},
      {{"replicate", "status"}, "rover1"},
      {{"role", "show"}, "rover3"},
      {{"role", "history"}, "rover1"},
      {{"db", "info"}, "rover3"},
      {{"db", "holdings"}, "rover3"},
      {{"db", "diff", "rover1", "rover3"}, "ORIGIN"},
      {{"db", "verify"}, "rover3"},
      {{"log"}, "role swap"},
      {{"trace", "-a", "rover3"}, "AGO"},
      {{"map", "stats"}, "free"},
      {{"graph", "stats"}, "solved"},
      {{"downlink", "list"}, ""},
      {{"drive", "on", "--for", "5", "-a", "rover3"}, "drives"},
      {{"drive", "off", "-a", "rover3"}, "rover3"},
  };
  for (const auto& [words, says] : commands) {
    const Outcome outcome = At("rover2", words);
    std::string line = "moonctl";
    for (const std::string& word : words) line += " " + word;
    SCOPED_TRACE(line);
    const bool is_diff = words[0] == "db" && words[1] == "diff";
    EXPECT_EQ(outcome.exit_code, is_diff ? 1 : 0) << outcome.out << outcome.error;
    EXPECT_THAT(outcome.out, AllOf(HasSubstr(says), Not(HasSubstr("unreachable"))));
    EXPECT_THAT(outcome.error, HasSubstr(kThroughRover2));
    EXPECT_EQ(outcome.error.find("through"), outcome.error.rfind("through")) << "once a command";
  }
  EXPECT_EQ(AtRover2(0, {"-a", "rover2", "status"}).error, "") << "its own agent is asked itself";
}

TEST_F(FourMachinesTest, AnAgentOutsideCommandFromRelaysOnlyQueries) {
  EXPECT_EQ(At("rover3", {"status"}).exit_code, 0);
  const Outcome refused = At("rover3", {"-a", "rover1", "record", "insert", "temperature", "{\"celsius\": 1}"});
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_THAT(refused.error, HasSubstr("rover1 takes no commands relayed by rover3: command_from of its team file"));
  EXPECT_EQ(At("rover3", {"role", "swap", "-a", "rover3"}).exit_code, 4) << "it neither leads nor survives";
  EXPECT_EQ(At("rover3", {"-a", "rover3", "record", "insert", "temperature", "{\"celsius\": 1}"}).exit_code, 0);
  EXPECT_THAT(At("rover2", {"log"}).out, HasSubstr("refused insert relayed by rover3"));
  EXPECT_THAT(At("rover2", {"health"}).out, HasSubstr("relayed by rover3"));
  EXPECT_THAT(At("rover2", {"health", "acknowledge"}).out, HasSubstr("1 refused commands"));
  EXPECT_THAT(At("rover2", {"health"}).out, Not(HasSubstr("relayed by rover3")));
  EXPECT_THAT(At("rover3", {"log", "-a", "rover3"}).out, HasSubstr("refused role swap"));
}

TEST_F(FourMachinesTest, JsonIsOneDocumentAndNamesTheRelay) {
  environment_["MOONDB_TEAM"] = MachineOf("rover2") / "team.yaml";
  const auto status = MoonctlJson(0, {"status"});
  EXPECT_EQ(status.fields().at("via").string_value(), "rover2");
  EXPECT_EQ(status.fields().at("agents").list_value().values_size(), 4);
  EXPECT_EQ(MoonctlJson(0, {"-a", "rover2", "status"}).fields().count("via"), 0u);
  EXPECT_EQ(MoonctlJson(0, {"-a", "rover1", "role", "history"}).fields().at("via").string_value(), "rover2");
  const auto missing = MoonctlJson(1, {"-a", "rover1", "record", "get", "1.0000000000000001.1.1"});
  EXPECT_EQ(missing.fields().at("via").string_value(), "rover2");
  EXPECT_EQ(missing.fields().at("error").struct_value().fields().at("code").string_value(), "not_found");
}

TEST_F(FourMachinesTest, ReportsWhichAgentsAreElsewhereAndWhichAreLost) {
  EndOn("rover3");
  const Outcome status = AtRover2(3, {"status"});
  EXPECT_THAT(status.out, HasSubstr("agent rover3 is not on this machine; rover2 has not heard it for "));
  EXPECT_THAT(status.out, Not(HasSubstr("is not running")));
  EXPECT_THAT(status.out, HasSubstr("leader"));

  // A leader that other agents still reach does not count as lost, even if it does not answer.
  agents_.at("rover1")->Signal(SIGSTOP);
  const Outcome silent = AtRover2(5, {"sync", "now", "--timeout", "1s"});
  EXPECT_THAT(silent.error, HasSubstr("agent rover1 is not on this machine, rover2 heard it "));
  EXPECT_THAT(silent.error, Not(HasSubstr("role set")));
  agents_.at("rover1")->Signal(SIGCONT);

  EndOn("rover1");
  const Outcome lost = AtRover2(3, {"sync", "now"});
  EXPECT_THAT(lost.error, HasSubstr("agent rover1 is not on this machine; rover2 has not heard it for "));
  EXPECT_THAT(lost.error,
              HasSubstr("it is the leader: if it is lost, make the survivor the leader with moonctl role set"));
  const Outcome set = At("rover2", {"role", "set", "rover2", "leader", "rover3", "survivor"});
  EXPECT_THAT(set.out, HasSubstr("leader rover2")) << set.error;

  // If no agent runs, the output names this machine's agent and why the others cannot be asked.
  EndOn("base");
  agents_.at("rover2")->Signal(SIGTERM);
  (void)agents_.at("rover2")->Wait();
  agents_.clear();
  const Outcome nobody = AtRover2(3, {"status"});
  EXPECT_THAT(nobody.out, HasSubstr("agent rover2 is not running ("));
  EXPECT_THAT(nobody.out,
              HasSubstr("agent rover1 is not on this machine, and no agent of team moon runs here: give --key"));
}

TEST_F(FourMachinesTest, UpAndDownAffectOnlyAgentsWhoseSecretKeysAreHere) {
  const Outcome up = At("rover3", {"up"});
  EXPECT_EQ(up.exit_code, 0) << up.out << up.error;
  EXPECT_THAT(up.out, AllOf(HasSubstr("was running"), Not(HasSubstr("rover1")), Not(HasSubstr("failed"))));
  const Outcome down = At("rover3", {"down"});
  EXPECT_EQ(down.exit_code, 0) << down.out << down.error;
  EXPECT_THAT(down.out, AllOf(HasSubstr("rover3"), Not(HasSubstr("rover1")), Not(HasSubstr("not running"))));
  (void)agents_.at("rover3")->Wait();
  agents_.erase("rover3");
  EXPECT_EQ(AtRover2(0, {"-a", "rover2", "status"}).exit_code, 0) << "others go on";

  for (const char* ending : {".sec", ".sign"})
    std::filesystem::remove(MachineOf("rover3") / ("rover3" + std::string(ending)));
  const Outcome nothing = At("rover3", {"up"});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.error, HasSubstr("this machine has no secret key of an agent of team moon"));
}

TEST_F(FourMachinesTest, TheBaseStationGivesRolesOnceLeaderAndSurvivorAreLost) {
  EndOn("rover1");
  agents_.at("rover2")->Signal(SIGKILL);
  (void)agents_.at("rover2")->Wait();
  agents_.erase("rover2");
  const Outcome set = At("base", {"role", "set", "rover3", "leader", "rover1", "survivor"});
  EXPECT_THAT(set.out, HasSubstr("leader rover3, survivor rover1")) << set.error;
  EXPECT_EQ(set.exit_code, 3) << "rover1 has not confirmed";
}

TEST_F(FourMachinesTest, TheEnvironmentNamesTheRelay) {
  environment_["MOONDB_VIA"] = "rover2";
  EXPECT_EQ(AtRover2(0, {"-a", "rover3", "role", "history"}).error, kThroughRover2);
  environment_["MOONDB_VIA"] = "rover9";
  EXPECT_THAT(AtRover2(2, {"status"}).error, HasSubstr("MOONDB_VIA: team moon has no agent \"rover9\""));
  EXPECT_EQ(AtRover2(0, {"status", "--via", "rover2"}).error, kThroughRover2) << "the option wins";
  MoonctlExpecting(0, {"-t", MachineOf("rover2") / "team.yaml", "-a", "rover2", "down"});
}

TEST_F(FourMachinesTest, FindsAnAgentWhoseSocketIsElsewhereAndSaysWhereItIsGone) {
  const std::string endpoint = ReadEndpoint(DataOf("rover2"));
  EXPECT_THAT(endpoint, HasSubstr((MachineOf("rover2") / "run").string()));
  EXPECT_THAT(AtRover2(0, {"-a", "rover2", "up"}).out, HasSubstr("was running"));
  EXPECT_THAT(AtRover2(0, {"-a", "rover2", "down"}).out, HasSubstr("stopped"));
  (void)agents_.at("rover2")->Wait();
  EXPECT_THAT(AtRover2(3, {"-a", "rover2", "status"}).out, HasSubstr("agent rover2 is not running (no socket"));

  StartOn("rover2");
  ASSERT_TRUE(Until([&] { return At("rover2", {"-a", "rover2", "status"}).exit_code == 0; }));
  const std::string path = endpoint.substr(std::string("ipc://").size());
  agents_.at("rover2")->Signal(SIGSTOP);
  std::filesystem::remove_all(std::filesystem::path(path).parent_path());
  const std::string gone = "agent rover2 runs as process " + std::to_string(agents_.at("rover2")->pid()) +
                           ", but its socket " + path + " is missing; ";
  EXPECT_THAT(AtRover2(3, {"-a", "rover2", "status"}).out, HasSubstr(gone));
  agents_.at("rover2")->Signal(SIGCONT);
  EXPECT_TRUE(Until([&] { return At("rover2", {"-a", "rover2", "status"}).exit_code == 0; })) << "it listens again";
  EXPECT_THAT(AtRover2(0, {"-a", "rover2", "down"}).out, HasSubstr("stopped"));
}

}  // namespace
}  // namespace moondb
