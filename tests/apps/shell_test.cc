// Tests the completion scripts in their shells, and the manual page in groff. Programs that are not installed are
// skipped.

#include <gmock/gmock.h>

#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

class ShellTest : public ProcessTeam {
 protected:
  void SetUp() override {
    ProcessTeam::SetUp();
    environment_["MOONCTL"] = MOONCTL_PROGRAM;
    environment_["FOLDER"] = folder_;
    environment_["PATH"] = std::filesystem::path(MOONCTL_PROGRAM).parent_path().string() + ":" + std::getenv("PATH");
  }
  Outcome RunIn(const std::string& shell, const std::string& script) {
    return Run({"/usr/bin/env", shell, "-c", script});
  }
  bool HasProgram(const std::string& name) { return RunIn("sh", "command -v " + name).exit_code == 0; }
};

TEST_F(ShellTest, BashCompletesCommandsAgentsAndFiles) {
  const std::string script = R"(
source <("$MOONCTL" completion bash)
complete -p moonctl
ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _moonctl; echo "[${COMPREPLY[*]}]"; }
ask moonctl sta
ask moonctl role set ro
ask moonctl status --agent = ba
ask moonctl -t nowhere.yaml -a ""
ask moonctl graph import ""
)";
  const Outcome outcome = RunIn("bash", script);
  EXPECT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.out, "complete -F _moonctl moonctl\n[status]\n[rover1 rover2 rover3]\n[base]\n[]\n[]\n");
}

TEST_F(ShellTest, FishCompletesCommandsAndAgents) {
  if (!HasProgram("fish")) GTEST_SKIP() << "fish is not installed";
  const Outcome outcome = RunIn("fish", R"("$MOONCTL" completion fish | source
complete -C 'moonctl sta'; complete -C 'moonctl role set ro'; complete -C 'moonctl config ')");
  EXPECT_THAT(outcome.out, HasSubstr("status\tShow one row for each configured agent"));
  EXPECT_THAT(outcome.out, HasSubstr("rover3\tagent"));
  EXPECT_THAT(outcome.out, HasSubstr("check\tCheck the team file"));
  EXPECT_EQ(outcome.error, "");
}

TEST_F(ShellTest, ZshCompletesCommandsAndAgents) {
  if (!HasProgram("zsh")) GTEST_SKIP() << "zsh is not installed";
  const Outcome outcome = RunIn("zsh", R"(autoload -U compinit; compinit -u -D; source <("$MOONCTL" completion zsh)
echo ${_comps[moonctl]}; _describe() { print -l -- ${(P)2} }
words=(moonctl role set ro); CURRENT=4; _moonctl)");
  EXPECT_EQ(outcome.out, "_moonctl\nrover1:agent\nrover2:agent\nrover3:agent\n");
}

TEST_F(ShellTest, TheManualPageIsSoundRoff) {
  if (!HasProgram("groff")) GTEST_SKIP() << "groff is not installed";
  const Outcome outcome = RunIn("bash", R"(set -o pipefail; "$MOONCTL" man | groff -man -ww -Tutf8 -P -cbou)");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.error, "") << "warnings";
  EXPECT_THAT(outcome.out, HasSubstr("moonctl role swap rover1 rover2 --dry-run"));
  EXPECT_THAT(outcome.out, HasSubstr("record insert temperature '{\"celsius\": -40.5}'"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("\\")));
}

TEST_F(ShellTest, AnotherValidatorAcceptsTheTeamFileByTheSchema) {
  const std::string python = "/usr/bin/python3 -W ignore -c";
  if (RunIn("sh", python + " 'import jsonschema, yaml'").exit_code != 0) {
    GTEST_SKIP() << "python3-jsonschema and python3-yaml are not installed";
  }
  const Outcome outcome = RunIn("bash", R"("$MOONCTL" config schema > "$FOLDER/schema.json" || exit 9
exec /usr/bin/python3 -W ignore - ")" MOONDB_CONFIGS R"(/cadre.yaml" "$FOLDER/schema.json" <<'PY'
import json, jsonschema, sys, yaml
schema = json.load(open(sys.argv[2]))
jsonschema.Draft7Validator.check_schema(schema)
team = yaml.safe_load(open(sys.argv[1]))
jsonschema.validate(team, schema)
team["agents"][0]["kind"] = "rovr"
try:
    jsonschema.validate(team, schema)
except jsonschema.ValidationError as error:
    print(error.message)
PY
)");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
  EXPECT_THAT(outcome.out, HasSubstr("'rovr' is not one of ['rover', 'base_station']"));
}

TEST_F(ShellTest, ShowsTheEffectiveConfigurationAsATeamFileAgain) {
  const Outcome shown = Moonctl({"config", "show"});
  EXPECT_EQ(shown.exit_code, 0);
  EXPECT_THAT(shown.out, HasSubstr("  survivor: \"rover2\"\n"));
  EXPECT_THAT(shown.out, HasSubstr("   # default\n"));
  const std::filesystem::path copy = team_file_.parent_path() / "shown.yaml";
  ASSERT_TRUE(WriteTextFile(copy, shown.out).has_value());
  const auto json = MoonctlJson(0, {"config", "show"});
  const auto again = MoonctlJson(0, {"config", "show", copy});
  EXPECT_EQ(again.fields().at("hash").string_value(), json.fields().at("hash").string_value());
  EXPECT_EQ(again.fields().at("defaults").list_value().values_size(), 0);
  EXPECT_GT(json.fields().at("defaults").list_value().values_size(), 0);
}

TEST_F(ShellTest, HelpIsAnAnswerAndNoError) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {}, {"help"}, {"role"}, {"help", "role"}, {"help", "role", "set"}, {"role", "--help"}}) {
    const Outcome outcome = Moonctl(words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_THAT(outcome.out, HasSubstr("Usage: "));
    EXPECT_EQ(outcome.error, "");
  }
  const Outcome mistyped = Moonctl({"help", "rol"});
  EXPECT_EQ(mistyped.exit_code, 2);
  EXPECT_THAT(mistyped.error, HasSubstr("unknown command \"rol\"; did you mean \"role\"?"));
}

}  // namespace
}  // namespace moondb
