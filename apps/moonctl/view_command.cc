#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"

namespace moondb {
namespace {

struct ViewArguments {
  std::string listen = "127.0.0.1";
  std::uint32_t port = 8600;
};

// Becomes moondb_view, so that the page ends with this command. Returns only if that fails.
ExitCode View(CommandContext& context, const ViewArguments& arguments) {
  if (const auto team = context.Team(); !team) return context.Report(team.error());
  const std::string program = context.program_folder() / "moondb_view";
  std::vector<std::string> words{program,          "--team", context.TeamPath().string(),   "--listen",
                                 arguments.listen, "--port", std::to_string(arguments.port)};
  if (!context.agent.empty()) words.insert(words.end(), {"--agent", context.agent});
  if (!context.key_file.empty()) words.insert(words.end(), {"--key", context.key_file});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execv(program.c_str(), argv.data());
  return context.Report({ErrorCode::kInternal, program + " cannot be started: " + std::strerror(errno), {}});
}

}  // namespace

void AddViewCommand(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<ViewArguments>();
  Command& view = AddCommand(app, "view", "Show the team on a web page, from the records of one agent (or -a)",
                             {"moonctl view --port 8600"});
  view.AddOption("--port", arguments->port, "Port on which the page is served; 0: any free port")
      .Within(0u, 65535u)
      .DefaultShown();
  view.AddOption("--listen", arguments->listen, "IP address on which the page is served")
      .TypeName("ADDRESS")
      .DefaultShown();
  view.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return View(context, *arguments); }; });
}

}  // namespace moondb
