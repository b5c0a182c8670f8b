// moondb_view: a page that shows the team by the records of one agent (docs/VIEW.md).
//
// Exit codes: 0 ended by SIGINT or SIGTERM, 1 failed, 2 the command line or the team file is wrong, 3 the agent or the
// port is not available.

#include <signal.h>

#include <cstdio>
#include <filesystem>
#include <random>
#include <set>
#include <utility>

#include "apps/common/arguments.h"
#include "apps/common/hash_text.h"
#include "apps/moondb_view/agent_watch.h"
#include "apps/moondb_view/foxglove_viewer.h"
#include "apps/moondb_view/http_server.h"
#include "apps/moondb_view/view_site.h"
#include "model/text.h"

namespace moondb {
namespace {

struct Arguments {
  std::string team;
  std::string agent;
  std::string key_file;
  std::string listen = "127.0.0.1";
  std::uint32_t port = 8600;
  double client_kbps = 0;
  std::vector<std::string> hosts;
};

void Print(const std::string& line) {
  std::fprintf(stderr, "moondb_view: %s\n", OneLine(line, 1024).c_str());
  std::fflush(stderr);
}

int Finish(const Error& error) {
  Print(ToString(error));
  if (error.code == ErrorCode::kInvalid || error.code == ErrorCode::kNotFound) return 2;
  return error.code == ErrorCode::kUnavailable ? 3 : 1;
}

std::filesystem::path OwnFolder() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

// Returns the agent to show: the given one, or the first of this machine that answers.
Result<const proto::AgentConfig*> ChooseAgent(CommandContext& context, const proto::TeamConfig& team,
                                              const std::string& name) {
  if (!name.empty()) return MemberNamed(team, name);
  for (const proto::AgentConfig& agent : team.agents()) {
    if (!agent.left() && context.ConnectHere(agent.name())) return &agent;
  }
  return Fail(ErrorCode::kUnavailable,
              "no agent of this team answers on this machine: start one with moonctl up, or "
              "name one with --agent and --key");
}

Result<void> Serve(const Arguments& arguments) {
  CommandContext context(OwnFolder());
  context.team_path = arguments.team;
  context.key_file = arguments.key_file;
  const Result<const TeamFile*> team = context.Team();
  if (!team) return tl::unexpected(team.error());
  const auto agent = ChooseAgent(context, (*team)->config, arguments.agent);
  if (!agent) return tl::unexpected(agent.error());
  // A wrong key or a name that nobody has is an error now. An agent that does not answer may come back.
  if (const auto connected = context.ConnectHere((*agent)->name()); !connected &&
                                                                    connected.error().code != ErrorCode::kUnavailable &&
                                                                    connected.error().code != ErrorCode::kTimedOut) {
    return tl::unexpected(connected.error());
  }
  std::random_device random;
  const std::string instance = HashText(static_cast<std::uint64_t>(random()) << 32 | random());
  Board board(instance);
  Channels channels;
  FoxgloveFeed foxglove(channels, (*team)->config);
  ViewSite site((*team)->config, board);
  HttpServer::Options options;
  options.address = arguments.listen;
  options.port = static_cast<std::uint16_t>(arguments.port);
  options.hosts = {arguments.hosts.begin(), arguments.hosts.end()};
  options.subprotocols = {"foxglove.sdk.v1", "foxglove.websocket.v1"};
  options.socket_kbps = arguments.client_kbps;
  options.make_peer = [&channels, name = (*team)->config.team(), instance](std::function<void()> wake) {
    return std::make_unique<FoxgloveViewer>(channels, "moondb: " + name, instance, std::move(wake));
  };
  const auto server = HttpServer::Start(options, [&site](const HttpRequest& request, HttpServer::Respond respond) {
    site.Handle(request, std::move(respond));
  });
  if (!server) return tl::unexpected(server.error());
  AgentWatch::Options watched;
  watched.program_folder = context.program_folder();
  watched.team_path = arguments.team;
  watched.agent = (*agent)->name();
  watched.key_file = arguments.key_file;
  watched.viewers = [&site, &channels] { return site.viewers() + channels.CountSubscriptions(); };
  watched.on_remark = Print;
  {
    AgentWatch watch(watched, (*team)->config, (*agent)->id(), board, foxglove);
    site.UseWatch(watch);
    std::printf("the page: http://%s:%u/\n", arguments.listen.c_str(), (*server)->port());
    std::printf("for Foxglove and Lichtblick: ws://%s:%u\n", arguments.listen.c_str(), (*server)->port());
    std::fflush(stdout);
    if (arguments.listen != "127.0.0.1") {
      Print("everyone who reaches " + arguments.listen + " sees the team: there is no password");
    }
    sigset_t ends;
    sigemptyset(&ends);
    sigaddset(&ends, SIGINT);
    sigaddset(&ends, SIGTERM);
    int signal = 0;
    (void)sigwait(&ends, &signal);
    site.End();
  }
  return {};
}

int Run(int argc, char** argv) {
  Arguments arguments;
  Command app("moondb_view", "Serves a page that shows the team by the records of one agent.");
  app.AddOption("-t,--team", arguments.team, "Team file").EnvName("MOONDB_TEAM").Required();
  app.AddOption("-a,--agent", arguments.agent, "The agent to ask (the first that answers on this machine)");
  app.AddOption("--key", arguments.key_file, "File of the secret key, for an agent with a client_address")
      .EnvName("MOONDB_CLIENT_KEY");
  app.AddOption("--listen", arguments.listen, "IP address of the page").DefaultShown();
  app.AddOption("--port", arguments.port, "Port of the page; 0: any free port").Within(0u, 65535u).DefaultShown();
  app.AddOption("--client-kbps", arguments.client_kbps,
                "The most that is sent to a Foxglove viewer, in kbit/s; 0: no limit")
      .Within(0.0, 1e6)
      .DefaultShown();
  app.AddOption("--allow-host", arguments.hosts, "A name under which browsers reach the page, beside localhost");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code == 0 ? 0 : 2;
  const Result<void> served = Serve(arguments);
  return served ? 0 : Finish(served.error());
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  signal(SIGPIPE, SIG_IGN);
  // Before the first thread, so that sigwait gets them.
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  return moondb::Run(argc, argv);
}
