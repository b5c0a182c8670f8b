// Runs every command of the real moonctl against a real team, while all agents run, while one is dead, and while one is
// frozen. Checks the text, the JSON and the exit code.
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <signal.h>

#include <algorithm>
#include <set>

#include "apps/common/arguments.h"
#include "apps/moonctl/command_line.h"
#include "apps/moonctl/command_tree.h"
#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using Words = std::vector<std::string>;

// A command and its expected exit codes. rover1 leads, rover2 is the designated survivor, and rover3 is killed or
// frozen.
struct Case {
  // The words after `moonctl`. In a word, % stands for the number of the pass, @ for the folder of the test, and KEY
  // for the key of a record of rover3.
  Words words;
  int when_well;  // Exit code if all agents run.
  int when_killed;
  int when_frozen;
  std::string says;  // Part of the text output if all agents run.
};

constexpr int kDone = 0, kFailed = 1, kUsage = 2, kUnreachable = 3;

const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {
      {{"status"}, kDone, kUnreachable, kUnreachable, "designated_survivor"},
      {{"status", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"health", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"health", "acknowledge"}, kDone, kUnreachable, kUnreachable, "ACKNOWLEDGED"},
      {{"risk"}, kDone, kUnreachable, kUnreachable, "ONE COPY"},
      {{"role", "show"}, kDone, kUnreachable, kUnreachable, "rover2"},
      {{"role", "history", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover1"},
      {{"role", "set", "rover2", "leader", "rover1", "survivor", "--dry-run"}, kDone, kDone, kDone, "rover2"},
      {{"role", "swap", "rover1", "rover2", "--dry-run"}, kDone, kDone, kDone, "rover2"},
      {{"sync", "now", "--from", "rover3"}, kDone, kDone, kDone, "rover1"},
      {{"sync", "status"}, kDone, kUnreachable, kUnreachable, "FROM"},
      {{"sync", "pause", "--for", "5", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "paused"},
      {{"sync", "resume", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"replicate", "now"}, kDone, kDone, kDone, "rover1"},
      {{"replicate", "status"}, kDone, kUnreachable, kUnreachable, "FROM"},
      {{"drive", "on", "--for", "5", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "drives"},
      {{"drive", "off", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"sleep", "--for", "5", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "sleeps"},
      {{"sleep", "off", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"graph", "import", "@/more.pyfg"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "optimize"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "stats"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "matches"}, kDone, kDone, kDone, "matched"},
      {{"graph", "quarantine", "rover2:4"}, kDone, kDone, kDone, "is in force"},
      {{"graph", "export", "@/out%.pyfg"}, kDone, kDone, kDone, "wrote"},
      {{"graph", "solve", "@/mission/graph.pyfg", "--out", "@/solved%.pyfg"}, kDone, kDone, kDone, "wrote"},
      {{"map", "export", "@/map%"}, kDone, kDone, kDone, "map.yaml"},
      {{"export", "mcap", "@/recording%"}, kDone, kDone, kDone, "messages"},
      {{"map", "why", "0", "0"}, kDone, kDone, kDone, "rover"},
      {{"map", "stats"}, kDone, kDone, kDone, "rover"},
      {{"map", "overlap", "rover1:0", "rover2:0", "--out", "@/overlap%.png"}, kDone, kDone, kDone, "COMMON"},
      {{"map", "quarantine", "--agent", "rover2", "--from", "2026-11-21T10:00Z"}, kDone, kDone, kDone, "is in force"},
      {{"record", "insert", "temperature", "{\"celsius\": -40}", "-a", "rover3"},
       kDone,
       kUnreachable,
       kUnreachable,
       "3."},
      {{"record", "list", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "temperature"},
      {{"record", "list", "--since", "1h", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "temperature"},
      {{"record", "list", "--history", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "KEY"},
      {{"record", "get", "KEY", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "pose_graph_node"},
      {{"record", "next-node", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, ""},
      {{"db", "info"}, kDone, kUnreachable, kUnreachable, "DATABASE"},
      {{"db", "holdings"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"db", "verify", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"db", "diff", "rover1", "rover3"}, kFailed, kUnreachable, kUnreachable, "ORIGIN"},
      {{"db", "prune", "--older-than", "30d", "-a", "rover1", "--dry-run"}, kDone, kDone, kDone, "all"},
      {{"db", "prune", "--history", "-a", "rover1"}, kDone, kDone, kDone, "all"},
      // `db query` and `db backup` read the database file, so they need no agent.
      {{"db", "query", "select count(*) as n from temperature", "-a", "rover3"}, kDone, kDone, kDone, "n"},
      {{"db", "backup", "@/rover3-%.sqlite", "-a", "rover3"}, kDone, kDone, kDone, "wrote"},
      {{"downlink", "--budget-kb", "64", "--out", "@/new%.bundle"}, kDone, kDone, kDone, "bundle 1"},
      {{"downlink", "list"}, kDone, kDone, kDone, "BUNDLE"},
      {{"downlink", "get", "%", "--out", "@/one%.bundle"}, kDone, kDone, kDone, "wrote"},
      {{"downlink", "show", "@/one%.bundle"}, kDone, kDone, kDone, "TYPE"},
      {{"log"}, kDone, kDone, kDone, "started"},
      {{"trace", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "AGO"},
      {{"config", "check"}, kDone, kDone, kDone, "no errors"},
      {{"config", "check", "--fix"}, kDone, kDone, kDone, "nothing to fix"},
      {{"config", "show"}, kDone, kDone, kDone, "agents"},
      {{"config", "schema"}, kDone, kDone, kDone, "definitions"},
      {{"config", "init", "@/other%/team.yaml"}, kDone, kDone, kDone, "wrote"},
      {{"clients", "add", "anna%", "--rights", "view"}, kDone, kDone, kDone, "anna1"},
      {{"config", "add-agent", "robot%", "--address", "tcp://127.0.0.1:950%", "-t", "@/other%/team.yaml"},
       kDone,
       kDone,
       kDone,
       "added robot1 (id 5)"},
      {{"config", "pack", "rover1", "@/rover1.%.pack"}, kDone, kDone, kDone, "files of rover1"},
      {{"config", "unpack", "@/rover1.%.pack", "@/robot%"}, kDone, kDone, kDone, "team.yaml"},
      // The findings of doctor depend on the machine (tests/apps/doctor_test.py).
      {{"doctor", "-a", "rover9"}, kUsage, kUsage, kUsage, ""},
      // The page is tested on its own (tests/apps/moondb_view).
      {{"view", "--port", "70000"}, kUsage, kUsage, kUsage, ""},
      {{"clients", "list"}, kDone, kDone, kDone, "anna1"},
      {{"clients", "revoke", "anna%"}, kDone, kDone, kDone, "anna1"},
      {{"keys", "new", "robot%"}, kDone, kDone, kDone, "robot1.sign"},
      {{"keys", "new", "bob%", "--client"}, kDone, kDone, kDone, "bob1"},
      {{"keys", "show"}, kDone, kDone, kDone, "rover1.sec, rover1.sign"},
      {{"keys", "add-signing"}, kDone, kDone, kDone, "nothing to add"},
      {{"completion", "bash"}, kDone, kDone, kDone, "moonctl"},
      {{"man"}, kDone, kDone, kDone, ".TH"},
      {{"help"}, kDone, kDone, kDone, "Usage"},
      {{"version"}, kDone, kDone, kDone, "moonctl"},
      {{"downlink", "ack", "%"}, kDone, kDone, kDone, "bundle 1"},
  };
  return cases;
}

// Commands that start or stop agents; other tests cover them.
const std::set<std::string> kUpAndDown = {"up", "down"};

// Returns true if `text` is {"error": ...}. Expects that `text` is one complete JSON document.
bool IsErrorJson(const std::string& text) {
  google::protobuf::Value value;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(text, &value).ok()) << text.substr(0, 300);
  return value.has_struct_value() && value.struct_value().fields().contains("error");
}

class EveryCommandTest : public ProcessTeam {
 protected:
  // Starts a team, inserts a mission's records, and waits until all of them are shared.
  void SetUp() override {
    environment_ = {
        {"MOONDB_RUN_DIR", folder_ / "run"}, {"MOONDB_TEAM", team_file_}, {"XDG_CONFIG_HOME", folder_ / "config"}};
    ASSERT_EQ(Run({MOONDB_MISSION_PROGRAM, "generate", "--seed", "7", "--minutes", "1", "--out", folder_ / "mission"})
                  .exit_code,
              0);
    MoonctlExpecting(kDone, {"config", "init", "--mission", folder_ / "mission", team_file_});
    AdaptToTest(team_file_, folder_);
    MoonctlExpecting(kDone, {"up", "--merge-backend", "cpu"});
    ASSERT_EQ(Run({MOONDB_REPLAY_PROGRAM, "feed", "--mission", folder_ / "mission"}).exit_code, 0);
    MoonctlExpecting(kDone, {"sync", "now", "--wait"});
    MoonctlExpecting(kDone, {"replicate", "now", "--wait"});
    const auto nodes = MoonctlJson(kDone, {"-a", "rover3", "record", "list", "pose_graph_node", "--limit", "1"});
    key_ = nodes.fields().at("records").list_value().values(0).struct_value().fields().at("key").string_value();
    ASSERT_TRUE(WriteTextFile(folder_ / "more.pyfg", "VERTEX_SE3:QUAT 900 A900 0 0 0 0 0 0 1\n"));
  }

  Outcome RunOne(const Case& one, bool is_json) {
    Words words = one.words;
    for (std::string& word : words) {
      if (word == "KEY") word = key_;
      if (word.starts_with("@/")) word.replace(0, 1, folder_.string());
      if (const std::size_t at = word.find('%'); at != std::string::npos) word.replace(at, 1, std::to_string(pass_));
    }
    words.insert(words.end(), {"--timeout", timeout_});
    if (is_json) words.emplace_back("--json");
    return Moonctl(words);
  }

  // Runs all commands with text output, then all with JSON output. `expected` is the member of Case that holds the
  // expected exit code.
  void RunAll(int Case::*expected) {
    std::vector<bool> are_errors;
    for (const bool is_json : {false, true}) {
      ++pass_;
      for (std::size_t i = 0; i < Cases().size(); ++i) {
        const Case& one = Cases()[i];
        std::string line = is_json ? "--json" : "";
        for (const std::string& word : one.words) line += " " + word;
        SCOPED_TRACE(line);
        const Outcome outcome = RunOne(one, is_json);
        EXPECT_EQ(outcome.exit_code, one.*expected) << outcome.out << outcome.error;
        if (is_json) {
          EXPECT_EQ(IsErrorJson(outcome.out), are_errors[i]) << outcome.out;
        } else {
          // A command that fails completely prints one line to stderr. Otherwise it prints the answers that it
          // received.
          are_errors.push_back(outcome.out.empty());
          if (outcome.out.empty()) {
            EXPECT_TRUE(outcome.error.starts_with("moonctl: ")) << outcome.error;
          }
        }
        if (!is_json && expected == &Case::when_well) {
          EXPECT_NE(outcome.out.find(one.says), std::string::npos) << outcome.out;
        }
      }
    }
  }

  std::string key_;
  std::string timeout_ = "3s";
  int pass_ = 0;
};

TEST_F(EveryCommandTest, ReportsItsResultWithAllWithDeadAndWithFrozenAgents) {
  RunAll(&Case::when_well);

  Kill("rover3");
  RunAll(&Case::when_killed);
  EXPECT_NE(MoonctlExpecting(kDone, {"up", "--merge-backend", "cpu"}).find("started"), std::string::npos);

  const pid_t frozen = PidOf("rover3");
  ASSERT_EQ(::kill(frozen, SIGSTOP), 0);
  timeout_ = "600ms";  // Short, because many commands wait until the timeout.
  RunAll(&Case::when_frozen);
  ASSERT_EQ(::kill(frozen, SIGCONT), 0);
  MoonctlExpecting(kDone, {"down"});
  MoonctlExpecting(kUnreachable, {"status"});
}

TEST(EveryCommandListTest, KnowsEveryCommand) {
  CommandContext context("");
  Command app;
  AddCommandLine(app, context);
  VisitCommands(app, [](const Command& command) {
    const std::string path = PathOf(command);
    if (!command.subcommands().empty() || kUpAndDown.contains(path)) return;
    const bool is_there = std::any_of(Cases().begin(), Cases().end(), [&path](const Case& one) {
      std::string words;
      for (const std::string& word : one.words) {
        words += (words.empty() ? "" : " ") + word;
        if (words == path) return true;
      }
      return false;
    });
    EXPECT_TRUE(is_there) << path;
  });
}

}  // namespace
}  // namespace moondb
