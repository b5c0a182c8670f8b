// moonctl: what an operator types. Verb after noun; exit codes in apps/moonctl/exit_code.h.

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>

#include "apps/common/json_writer.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/mistyped.h"

namespace moondb {
namespace {

void AddVersionCommand(CLI::App& app, CommandContext& context) {
  app.add_subcommand("version", "Show the version")->callback([&context] {
    context.action = [&context] {
      JsonWriter json;
      json.BeginObject().Key("version").String(MOONDB_VERSION).EndObject();
      return context.Done(json.text(), "moonctl " MOONDB_VERSION);
    };
  });
}

void AddEverything(CLI::App& app, CommandContext& context) {
  app.require_subcommand(1);
  app.fallthrough();  // Global options may stand behind the command.
  app.add_option("-t,--team", context.team_path, "Team file (default: $MOONDB_TEAM)");
  app.add_option("-a,--agent", context.agent, "Ask this agent");
  app.add_flag("--json", context.is_json, "One JSON document on stdout");
  app.add_option("--via", context.via, "Ask all agents through this one, over the radio: base");
  app.add_option("--timeout", context.timeout, "Longest wait for an answer: 3s, 500ms, 2m");
  app.set_version_flag("--version", "moonctl " MOONDB_VERSION);
  AddUpCommands(app, context);
  AddStatusCommand(app, context);
  AddHealthCommand(app, context);
  AddRoleCommands(app, context);
  AddShareCommands(app, context);
  AddLeaseCommands(app, context);
  AddGraphCommands(app, context);
  AddMapCommands(app, context);
  AddRecordCommands(app, context);
  AddDbCommands(app, context);
  AddLogCommand(app, context);
  AddTraceCommand(app, context);
  AddConfigCommands(app, context);
  AddVersionCommand(app, context);
}

std::filesystem::path OwnFolder() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

ExitCode Run(int argc, char** argv) {
  CommandContext context(OwnFolder());
  CLI::App app("Operates a team of moondb agents.", "moonctl");
  AddEverything(app, context);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return static_cast<ExitCode>(app.exit(error));  // --help
    const std::vector<std::string> words(argv + 1, argv + argc);
    const auto mistyped = DescribeMistyped(app, words);
    // The flag may stand behind what could not be parsed.
    context.is_json = std::find(words.begin(), words.end(), "--json") != words.end();
    return context.Report({ErrorCode::kInvalid, mistyped.value_or(error.what()), {}});
  }
  if (auto parsed = context.ParseTimeout(); !parsed) return context.Report(parsed.error());
  return context.action();
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  return static_cast<int>(moondb::Run(argc, argv));
}
