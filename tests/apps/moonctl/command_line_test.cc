// Checks that every command has a description, a valid example and an entry in the manual.

#include "apps/moonctl/command_line.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>

#include "apps/common/arguments.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"
#include "apps/moonctl/manual_page.h"
#include "model/text.h"

namespace moondb {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

class CommandLineTest : public testing::Test {
 protected:
  CommandLineTest() { AddCommandLine(app_, context_); }

  CommandContext context_{"."};
  Command app_{kProgramName, kProgramDescription};
};

TEST_F(CommandLineTest, DescribesEveryCommandAndItsArguments) {
  int count = 0;
  VisitCommands(app_, [&count](const Command& command) {
    ++count;
    SCOPED_TRACE(PathOf(command));
    EXPECT_NE(command.description(), "");
    for (const Option* option : command.options()) EXPECT_NE(option->description(), "") << option->name();
  });
  EXPECT_GT(count, 40);
}

TEST_F(CommandLineTest, EndsEveryHelpWithAnExample) {
  VisitCommands(app_, [this](const Command& command) {
    SCOPED_TRACE(PathOf(command));
    const CommandNote* note = NoteOf(command);
    ASSERT_NE(note, nullptr) << "AddCommand gives it one";
    const std::string_view last = Split(note->example, '\n').back();
    const std::string example = &command == &app_ ? "moonctl -t team.yaml status" : std::string(last);
    EXPECT_THAT(command.Help(), EndsWith("Example: " + example + "\n"));
  });
}

TEST_F(CommandLineTest, UnderstandsItsOwnExamples) {
  std::vector<std::pair<std::string, std::string>> examples;  // Each command's path and example.
  VisitCommands(app_, [&examples](const Command& command) {
    if (command.subcommands().empty() || !command.requires_subcommand()) {
      for (const std::string_view example : Split(NoteOf(command)->example, '\n')) {
        examples.emplace_back(PathOf(command), std::string(example));
      }
    }
  });
  EXPECT_GT(examples.size(), 40u);
  for (const auto& [path, example] : examples) {
    SCOPED_TRACE(example);
    CommandContext context{"."};
    Command app(kProgramName, kProgramDescription);
    AddCommandLine(app, context);
    // The shell handles the redirection, not moonctl.
    const auto stop = app.Parse(example.substr(0, example.find(" > ")));
    ASSERT_FALSE(stop.has_value()) << stop->error;
    EXPECT_TRUE(context.action != nullptr);
    EXPECT_EQ(PathOf(GivenCommand(app)), path);
  }
}

TEST_F(CommandLineTest, ShowsEveryCommandInAPage) {
  std::string pages;
  for (const auto& entry : std::filesystem::directory_iterator(MOONDB_COMMAND_PAGES)) {
    std::ifstream file(entry.path());
    pages.append(std::istreambuf_iterator<char>(file), {});
  }
  VisitCommands(app_, [this, &pages](const Command& command) {
    if (&command == &app_) return;
    const std::regex typed("moonctl( -\\S+ \\S+)* " + PathOf(command) + "\\b");
    EXPECT_TRUE(std::regex_search(pages, typed)) << PathOf(command) << " stands in no page of docs/commands";
  });
}

TEST_F(CommandLineTest, PutsEveryCommandIntoTheManual) {
  const std::string page = ManualPage(app_, "1.2");
  for (const char* line : {".SS role set pairs\n", ".SS map export folder\n", ".SS sleep off\n", ".SS status\n"}) {
    EXPECT_THAT(page, HasSubstr(line));
  }
  EXPECT_THAT(page, HasSubstr("\\fB\\-a, \\-\\-agent\\fR \\fIAGENT\\fR"));
  EXPECT_THAT(page, HasSubstr("moonctl \\-a rover2 record insert temperature \\(aq{"));
}

TEST_F(CommandLineTest, FindsTheCommandThatWordsName) {
  EXPECT_EQ(FindCommand(app_, {}), &app_);
  ASSERT_NE(FindCommand(app_, {"role", "set"}), nullptr);
  EXPECT_EQ(PathOf(*FindCommand(app_, {"role", "set"})), "role set");
  EXPECT_TRUE(FindCommand(app_, {"role"})->requires_subcommand());
  EXPECT_EQ(FindCommand(app_, {"role", "sett"}), nullptr);
  EXPECT_EQ(FindCommand(app_, {"status", "set"}), nullptr);
}

}  // namespace
}  // namespace moondb
