// Tests --watch and colours on a terminal and in a pipe.

#include <gmock/gmock.h>
#include <signal.h>

#include "tests/apps/process_team.h"
#include "tests/apps/terminal.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr char kClear[] = "\x1b[H\x1b[2J";
constexpr char kRed[] = "\x1b[31m";

class WatchTest : public ProcessTeam {
 protected:
  Terminal OnTerminal(std::vector<std::string> arguments, const std::map<std::string, std::string>& more = {}) {
    arguments.insert(arguments.begin(), MOONCTL_PROGRAM);
    std::map<std::string, std::string> environment = environment_;
    environment.insert({{"TERM", "xterm"}, {"NO_COLOR", ""}});
    for (const auto& [name, value] : more) environment[name] = value;
    return Terminal(std::move(arguments), environment);
  }
};

TEST_F(WatchTest, RedrawsATerminalAndExitsOnControlCWithTheLastPassCode) {
  MoonctlExpecting(0, {"up"});
  Terminal screen = OnTerminal({"status", "--watch=0.1"});
  EXPECT_THAT(screen.ShownUntil(kClear, 3), StartsWith(kClear));
  screen.Type("\x03");
  EXPECT_EQ(screen.Wait(), 0);
  Kill("rover2");
  Terminal other = OnTerminal({"status", "--watch=0.1"});
  EXPECT_THAT(other.ShownUntil(kClear, 2), HasSubstr("rover2"));
  other.Type("\x03");
  EXPECT_EQ(other.Wait(), 3);
}

TEST_F(WatchTest, PrintsBlocksOneAfterTheOtherIntoAPipe) {
  Child child({MOONCTL_PROGRAM, "role", "show", "--watch=0.1"}, environment_, folder_);
  ASSERT_TRUE(Until([&child] { return child.Out().find("\n\n") != std::string::npos; }));
  child.Signal(SIGINT);
  const Outcome outcome = child.Wait();
  EXPECT_EQ(outcome.exit_code, 3) << "nobody runs";
  EXPECT_THAT(outcome.out, HasSubstr("every 0.1 s\nAGENT"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("\x1b")));
  EXPECT_TRUE(outcome.out.ends_with('\n'));
}

TEST_F(WatchTest, PrintsOneJsonDocumentPerLine) {
  Child child({MOONCTL_PROGRAM, "trace", "--watch=0.1", "--json"}, environment_, folder_);
  ASSERT_TRUE(Until([&child] { return child.Out().find('\n') + 1 < child.Out().size(); }));
  child.Signal(SIGTERM);
  const Outcome outcome = child.Wait();
  EXPECT_EQ(outcome.exit_code, 3);
  std::istringstream lines(outcome.out);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_THAT(line, StartsWith("{\"error\":"));
    EXPECT_TRUE(line.ends_with("}"));
  }
}

TEST_F(WatchTest, RefusesCommandsThatChangeDataAndInvalidPeriods) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{"role", "swap"},
                                                {"sync", "now"},
                                                {"map", "export", folder_ / "x"},
                                                {"up"},
                                                {"config", "init", folder_ / "x"}}) {
    std::vector<std::string> watched = words;
    watched.push_back("--watch");
    const Outcome outcome = Moonctl(watched);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.error, HasSubstr("cannot be repeated"));
  }
  for (const char* option : {"--watch=0", "--watch=0.01", "--watch=x", "--watch=-1"}) {
    EXPECT_EQ(Moonctl({"status", option}).exit_code, 2) << option;
  }
  EXPECT_EQ(Moonctl({"status", "--watch", "-t", "missing.yaml"}).exit_code, 2) << "ends at once";
}

TEST_F(WatchTest, EndsWhenItsPipeIsClosed) {
  const Outcome outcome =
      Run({"/bin/bash", "-c", "set -o pipefail; " MOONCTL_PROGRAM " role show --watch=0.1 | head -n 2"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.error, HasSubstr("the result cannot be written: Broken pipe"));
  EXPECT_EQ(Run({"/bin/bash", "-c", MOONCTL_PROGRAM " version > /dev/full"}).exit_code, 1);
}

TEST_F(WatchTest, ShowsProblemsInRedOnATerminalUnlessColoursAreOff) {
  Terminal colored = OnTerminal({"status"});
  EXPECT_EQ(colored.Wait(), 3);
  EXPECT_THAT(colored.ShownUntil(""), HasSubstr(std::string(kRed) + "rover1   1  unreachable"));
  Terminal plain = OnTerminal({"status"}, {{"NO_COLOR", "1"}});
  plain.Wait();
  EXPECT_THAT(plain.ShownUntil(""), Not(HasSubstr("\x1b")));
  Terminal dumb = OnTerminal({"status"}, {{"TERM", "dumb"}});
  dumb.Wait();
  EXPECT_THAT(dumb.ShownUntil(""), Not(HasSubstr("\x1b")));
  EXPECT_THAT(Moonctl({"status"}).out, Not(HasSubstr("\x1b")));
}

}  // namespace
}  // namespace moondb
