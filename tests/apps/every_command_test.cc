// Every command of the real moonctl against a real team: all well, one agent killed, one agent frozen. What it prints as
// text and as JSON, and its exit code.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>

#include "apps/moonctl/command_line.h"
#include "apps/moonctl/command_tree.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using Words = std::vector<std::string>;

// rover1 leads, rover2 survives; it is rover3 that is killed or frozen.
struct Case {
  Words words;     // The command's own words first.
  int when_well;   // Exit codes.
  int when_killed;
  int when_frozen;
  std::string says;  // Among what it prints as text where all is well.
};

constexpr int kDone = 0, kFailed = 1, kUsage = 2, kUnreachable = 3, kRefused = 4, kTimedOut = 5;

const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {
      {{"status"}, kDone, kUnreachable, kUnreachable, "designated_survivor"},
      {{"status", "-a", "rover3"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"health"}, kDone, kFailed, kFailed, "rover3"},
      {{"up"}, kDone, kDone, kDone, "running"},
      {{"role", "show"}, kDone, kUnreachable, kUnreachable, "rover2"},
      {{"role", "history", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "rover1"},
      {{"role", "set", "rover2", "leader", "rover1", "survivor", "--dry-run"}, kDone, kDone, kDone, "rover2"},
      {{"role", "swap", "rover1", "rover2", "--dry-run"}, kDone, kDone, kDone, "rover2"},
      {{"sync", "now", "--from", "rover3"}, kDone, kDone, kDone, "rover1"},
      {{"sync", "status"}, kDone, kUnreachable, kUnreachable, "FROM"},
      {{"replicate", "now"}, kDone, kDone, kDone, "rover1"},
      {{"replicate", "status"}, kDone, kUnreachable, kUnreachable, "FROM"},
      {{"drive", "on", "--for", "5", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "drives"},
      {{"drive", "off", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "rover3"},
      {{"sleep", "--for", "5", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "sleeps"},
      {{"sleep", "off", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "rover3"},
      {{"graph", "import", "mission.pyfg"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "optimize"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "stats"}, kDone, kDone, kDone, "nodes"},
      {{"graph", "export", "out.pyfg"}, kDone, kDone, kDone, "wrote"},
      {{"graph", "solve", "mission.pyfg", "--out", "solved.pyfg"}, kDone, kDone, kDone, "solved.pyfg"},
      {{"map", "export", "map"}, kDone, kUnreachable, kUnreachable, "map.yaml"},
      {{"map", "why", "0", "0"}, kDone, kDone, kDone, "rover"},
      {{"map", "stats"}, kDone, kDone, kDone, "rover"},
      {{"map", "quarantine", "--agent", "rover2", "--from", "2026-11-21T10:00Z"}, kDone, kDone, kDone, "rover2"},
      {{"record", "insert", "temperature", "{\"celsius\": -40}", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "3."},
      {{"record", "list", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "temperature"},
      {{"record", "get", "KEY", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "-40"},
      {{"db", "info"}, kDone, kUnreachable, kUnreachable, "DATABASE"},
      {{"db", "holdings"}, kDone, kUnreachable, kUnreachable, "rover3"},
      {{"db", "verify", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "rover3"},
      {{"db", "diff", "rover1", "rover3"}, kDone, kUnreachable, kTimedOut, "ORIGIN"},
      // The file itself, which needs no agent.
      {{"db", "query", "select count(*) as n from temperature", "-a", "rover3"}, kDone, kDone, kDone, "n"},
      {{"db", "backup", "rover3.sqlite", "-a", "rover3"}, kDone, kDone, kDone, "wrote"},
      {{"downlink", "--budget-kb", "64"}, kDone, kDone, kDone, "bundle 1"},
      {{"downlink", "list"}, kDone, kDone, kDone, "BUNDLE"},
      {{"downlink", "get", "1", "--out", "one.bundle"}, kDone, kDone, kDone, "wrote one.bundle"},
      {{"downlink", "show", "one.bundle"}, kDone, kDone, kDone, "TYPE"},
      {{"log"}, kDone, kUnreachable, kUnreachable, "started"},
      {{"trace", "-a", "rover3"}, kDone, kUnreachable, kTimedOut, "AGO"},
      {{"config", "check"}, kDone, kDone, kDone, "rover"},
      {{"config", "show"}, kDone, kDone, kDone, "agents"},
      {{"config", "schema"}, kDone, kDone, kDone, "definitions"},
      {{"config", "init", "other/team.yaml"}, kDone, kDone, kDone, "wrote"},
      {{"completion", "bash"}, kDone, kDone, kDone, "moonctl"},
      {{"man"}, kDone, kDone, kDone, ".TH"},
      {{"version"}, kDone, kDone, kDone, "moonctl"},
      {{"downlink", "ack", "1"}, kDone, kDone, kDone, "bundle 1"},
      {{"down", "-a", "rover3"}, kDone, kDone, kDone, "rover3"},
  };
  return cases;
}

class EveryCommandTest : public ProcessTeam {
 protected:
  void SetUp() override {
    ProcessTeam::SetUp();
    MoonctlExpecting(kDone, {"up"});
  }
  void RunAll(int Case::*expected) {
    for (const Case& one : Cases()) {
      Words words = one.words;
      words.insert(words.end(), {"--timeout", "400ms"});
      const Outcome text = Moonctl(words);
      std::string line;
      for (const std::string& word : words) line += word + " ";
      std::cout << text.exit_code << " " << line << "| " << text.out.substr(0, 70) << text.error.substr(0,150) << "\n";
      (void)expected;
    }
  }
};

TEST_F(EveryCommandTest, Probe) {
  RunAll(&Case::when_well);
  std::cout << "=== killed\n";
  (void)Moonctl({"up"});
  Kill("rover3");
  RunAll(&Case::when_killed);
  std::cout << "=== frozen\n";
  (void)Moonctl({"up"});
  ASSERT_EQ(::kill(PidOf("rover3"), SIGSTOP), 0);
  RunAll(&Case::when_frozen);
}

}  // namespace
}  // namespace moondb
