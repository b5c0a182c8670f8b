// moonctl: the operator's command-line tool. Commands are a noun and a verb ("role set"). Exit codes:
// apps/moonctl/exit_code.h.

#include <sys/prctl.h>

#include <csignal>
#include <cstdio>

#include "apps/common/arguments.h"
#include "apps/moonctl/command_line.h"
#include "apps/moonctl/command_tree.h"
#include "apps/moonctl/completion_command.h"
#include "apps/moonctl/mistyped.h"
#include "apps/moonctl/watch.h"

namespace moondb {
namespace {

std::filesystem::path OwnFolder() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

ExitCode Run(int argc, char** argv) {
  CommandContext context(OwnFolder());
  Command app(kProgramName, kProgramDescription);
  AddCommandLine(app, context);
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words.front() == kCompleteWord) {
    return PrintCompletions(app, {words.begin() + 1, words.end()}, context);
  }
  if (const std::optional<ParseStop> stop = app.Parse(argc, argv)) {
    if (stop->exit_code == 0) return ExitCode::kDone;  // The user gave --help or --version.
    const Command* group = FindCommand(app, words);
    if (group != nullptr && group->requires_subcommand()) {  // Only "moonctl role" or "moonctl".
      std::fputs(group->Help().c_str(), stdout);
      return ExitCode::kDone;
    }
    const auto mistyped = DescribeMistyped(app, words);
    // Search all words for --json, because parsing may have failed before it.
    context.is_json = std::find(words.begin(), words.end(), "--json") != words.end();
    return context.Report({ErrorCode::kInvalid, mistyped.value_or(stop->error), {}});
  }
  if (auto parsed = context.ParseTimeout(); !parsed) return context.Report(parsed.error());
  return context.watch.empty() ? context.action() : RunWatched(app, context);
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  (void)::prctl(PR_SET_DUMPABLE, 0);  // The process may hold secret keys. Write no core file.
  return static_cast<int>(moondb::Run(argc, argv));
}
