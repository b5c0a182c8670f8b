#include "apps/moonctl/watch.h"

#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <thread>

#include "apps/common/table.h"
#include "apps/common/terminal.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr char kClear[] = "\x1b[H\x1b[2J";
constexpr std::size_t kBlockBytes = 1 << 20;

volatile sig_atomic_t last_code = 0;

// Handles SIGINT and SIGTERM. The process may exit at any time, because each run of the command writes its output in
// one call at the end.
void EndWatch(int) { ::_exit(last_code); }

std::string Heading(const CommandContext& context, std::chrono::milliseconds period, bool is_first) {
  if (context.is_json) return "";
  const std::string when =
      FormatUtc(UtcNowNs()) + ", every " + FormatDouble(static_cast<double>(period.count()) / 1000) + " s";
  return IsOnTerminal() ? kClear + when + "; Ctrl-C ends\n" : (is_first ? "" : "\n") + when + "\n";
}

}  // namespace

ExitCode RunWatched(const Command& root, CommandContext& context) {
  const Command& command = GivenCommand(root);
  const CommandNote* note = NoteOf(command);
  if (note == nullptr || !note->is_showing) {
    return context.Report(
        {ErrorCode::kInvalid, PathOf(command) + " is not a read-only command, so it cannot be repeated", "--watch"});
  }
  const auto period = ParseDuration(context.watch);
  if (!period || *period < std::chrono::milliseconds(100)) {
    return context.Report(
        {ErrorCode::kInvalid, "expected at least 0.1 seconds, got \"" + context.watch + "\"", "--watch"});
  }
  std::setvbuf(stdout, nullptr, _IOFBF, kBlockBytes);
  ::signal(SIGINT, EndWatch);
  ::signal(SIGTERM, EndWatch);
  for (bool is_first = true;; is_first = false) {
    context.heading = Heading(context, *period, is_first);
    const ExitCode code = context.action();
    last_code = static_cast<int>(code);
    if (code == ExitCode::kUsage || std::ferror(stdout) != 0) return code;
    std::this_thread::sleep_for(*period);
  }
}

}  // namespace moondb
