#include "apps/moonctl/completion.h"

#include <gmock/gmock.h>

#include "apps/common/arguments.h"
#include "apps/moonctl/command_line.h"

namespace moondb {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Not;

class CompletionTest : public testing::Test {
 protected:
  CompletionTest() { AddCommandLine(app_, context_); }

  std::vector<std::string> WordsFor(const std::vector<std::string>& typed) {
    std::vector<std::string> words;
    for (const Candidate& candidate : Complete(app_, typed, team_).candidates) words.push_back(candidate.word);
    return words;
  }

  CommandContext context_{"."};
  Command app_{kProgramName, kProgramDescription};
  const TeamWords team_{{"rover1", "rover2", "base"}, {"power", "pose_graph_node"}};
};

TEST_F(CompletionTest, KnowsCommandsAtEachLevel) {
  EXPECT_THAT(WordsFor({"st"}), ElementsAre("status"));
  EXPECT_THAT(WordsFor({"role", "s"}), ElementsAre("show", "set", "swap"));
  EXPECT_THAT(WordsFor({"--json", "-a", "rover1", "role", "h"}), ElementsAre("history"));
  EXPECT_THAT(WordsFor({""}), Contains("completion"));
  EXPECT_THAT(WordsFor({"nonsense", "role", "x"}), IsEmpty());
}

TEST_F(CompletionTest, KnowsOptionsOfACommandAndOfThoseAbove) {
  EXPECT_THAT(WordsFor({"role", "set", "--dr"}), ElementsAre("--dry-run"));
  EXPECT_THAT(WordsFor({"role", "set", "--ag"}), ElementsAre("--agent"));
  EXPECT_THAT(WordsFor({"role", "show", "--dr"}), IsEmpty());
}

TEST_F(CompletionTest, CompletesAgentNames) {
  EXPECT_THAT(WordsFor({"-a", "ro"}), ElementsAre("rover1", "rover2"));
  EXPECT_THAT(WordsFor({"--agent=b"}), ElementsAre("--agent=base"));
  EXPECT_THAT(WordsFor({"status", "--agent", "=", "b"}), ElementsAre("base")) << "as bash cuts --agent=b";
  EXPECT_THAT(WordsFor({"db", "diff", "rover1", "rover"}), ElementsAre("rover1", "rover2"));
  EXPECT_THAT(WordsFor({"role", "set", "rover2", "le"}), ElementsAre("leader"));
  EXPECT_THAT(WordsFor({"map", "quarantine", "--from", "r"}), IsEmpty()) << "a time";
}

TEST_F(CompletionTest, KnowsChoicesDataTypesAndFiles) {
  EXPECT_THAT(WordsFor({"graph", "export", "x", "--format", "t"}), ElementsAre("tum"));
  EXPECT_THAT(WordsFor({"record", "insert", "pos"}), ElementsAre("pose_graph_node"));
  EXPECT_TRUE(Complete(app_, {"graph", "import", ""}, team_).is_file);
  EXPECT_TRUE(Complete(app_, {"-t", ""}, team_).is_file);
  EXPECT_FALSE(Complete(app_, {"record", "insert", ""}, team_).is_file);
  EXPECT_TRUE(Complete(app_, {"graph", "import", "a.g2o", ""}, team_).is_file) << "it takes several";
  EXPECT_FALSE(Complete(app_, {"graph", "export", "a.pyfg", ""}, team_).is_file) << "it takes one";
  EXPECT_THAT(WordsFor({}), Contains("status"));
}

}  // namespace
}  // namespace moondb
