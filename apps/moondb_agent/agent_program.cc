#include "apps/moondb_agent/agent_program.h"

#include <malloc.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <optional>

#include "apps/common/arguments.h"
#include "apps/common/data_folder.h"
#include "apps/common/process_limits.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_agent/service_notify.h"
#include "runtime/log.h"

namespace moondb {
namespace {

enum ExitCode : int { kStopped = 0, kFailed = 1, kUsage = 2, kBeyondHelp = 70 };

// Time limit for stopping. After this time, SIGALRM ends the process, which loses no acknowledged record.
constexpr unsigned kStopSecondsMax = 5;

constexpr int kLargeBufferBytes = 4 * 1024 * 1024;
constexpr rlim_t kOpenFilesWanted = 65'536;

struct Arguments {
  std::string team;
  std::string agent;
  std::string data_folder;
  std::string log_level = "info";
  std::string log_file;
  std::string log_format = "text";
  std::string merge_backend = "auto";
  std::string secret_key;
  std::string clients_file;
};

void AddOptions(Command& app, Arguments& arguments) {
  app.AddOption("-t,--team", arguments.team, "Team file").Required();
  app.AddOption("-a,--agent", arguments.agent, "Name of this agent in the team file").Required();
  app.AddOption("--data-dir", arguments.data_folder, "Data folder (moondb-data/AGENT beside the team file)");
  app.AddOption("--log-level", arguments.log_level, "Lowest level to log")
      .OneOf({"trace", "debug", "info", "warn", "error", "off"});
  app.AddOption("--log-file", arguments.log_file, "Log to this file too, rotated at 10 MB (default: only stderr)");
  app.AddOption("--log-format", arguments.log_format, "Lines of text, or one JSON object per line")
      .OneOf({"text", "json"});
  app.AddOption("--merge-backend", arguments.merge_backend, "Backend that merges maps").OneOf({"auto", "cpu", "gl"});
  app.AddOption("--clients", arguments.clients_file,
                "File that lists the clients that may use client_address (default: clients.yaml beside the team file)");
  app.AddOption("--secret-key", arguments.secret_key, "File of the secret key (beside the public one, as .sec)");
}

int Complain(const AgentProgram& program, int code, const std::string& text) {
  std::fprintf(stderr, "%s: %s\n", program.name.c_str(), text.c_str());
  return code;
}

// Waits until a signal arrives or one of the agent's threads calls Wake.
class StopWaiter {
 public:
  // Blocks the signals that Wait waits for. Requires: no other thread has started, because threads inherit the blocked
  // signals.
  StopWaiter() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    signal_descriptor_ = ::signalfd(-1, &signals, SFD_CLOEXEC);
    event_descriptor_ = ::eventfd(0, EFD_CLOEXEC);
  }
  ~StopWaiter() {
    ::close(signal_descriptor_);
    ::close(event_descriptor_);
  }
  StopWaiter(const StopWaiter&) = delete;
  StopWaiter& operator=(const StopWaiter&) = delete;

  // Makes Wait return. Wait returns the first exit code other than kStopped, or kStopped if there is none. Thread-safe.
  void Wake(int exit_code) {
    int expected = kStopped;
    if (exit_code != kStopped) exit_code_.compare_exchange_strong(expected, exit_code);
    const std::uint64_t one = 1;
    (void)!::write(event_descriptor_, &one, sizeof(one));
  }

  // Blocks until a signal arrives or Wake is called. Returns the exit code.
  int Wait() {
    pollfd descriptors[] = {{signal_descriptor_, POLLIN, 0}, {event_descriptor_, POLLIN, 0}};
    while (::poll(descriptors, 2, -1) <= 0) {
    }
    return exit_code_;
  }

  int exit_code() const { return exit_code_; }

 private:
  int signal_descriptor_ = -1;
  int event_descriptor_ = -1;
  std::atomic<int> exit_code_ = kStopped;
};

Result<std::filesystem::path> DataFolderOf(const Arguments& arguments, const TeamFile& team,
                                           const proto::AgentConfig& agent) {
  if (!arguments.data_folder.empty()) return std::filesystem::path(arguments.data_folder);
  return FindDataFolder(DefaultDataRoot(team.folder), team.config, agent);
}

AgentOptions MakeOptions(const Arguments& arguments, const AgentProgram& program, StopWaiter& waiter) {
  AgentOptions options;
  options.name = arguments.agent;
  options.merge_backend = *ParseMergeBackend(arguments.merge_backend);  // Valid: the command line was checked.
  options.secret_key_file = arguments.secret_key;
  options.clients_file = arguments.clients_file;
  options.version = program.version;
  options.on_stop_requested = [&waiter] { waiter.Wake(kStopped); };
  options.on_fatal = [&waiter](const Error& error) {
    spdlog::critical("{}", ToString(error));
    waiter.Wake(kBeyondHelp);
  };
  options.on_healthy = [] { NotifyService("WATCHDOG=1"); };
  return options;
}

// Makes malloc return freed buffers of at least kLargeBufferBytes to the system. By default, glibc raises this
// threshold to the size of freed buffers, up to 32 MiB, and each thread would keep up to twice that size.
void GiveLargeBuffersBack() { (void)::mallopt(M_MMAP_THRESHOLD, kLargeBufferBytes); }

void RaiseOpenFiles() {
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  const rlim_t wanted = std::min(files.rlim_max, kOpenFilesWanted);
  if (files.rlim_cur < wanted) {
    files.rlim_cur = wanted;
    (void)::setrlimit(RLIMIT_NOFILE, &files);
  }
  if (files.rlim_cur >= kOpenFilesLeast) return;
  spdlog::warn(
      "this process may open only {} files; raise the limit (ulimit -Hn) to {}, or many connections can end this agent",
      files.rlim_cur, kOpenFilesLeast);
}

// Reads the command line. Returns the exit code if the program must end now, otherwise nothing.
std::optional<int> ReadCommandLine(int argc, char** argv, const AgentProgram& program, Arguments& arguments) {
  Command app(program.name, "Runs one agent of a moondb team.");
  AddOptions(app, arguments);
  app.AddVersionFlag("--version", program.name + " " + program.version);
  if (program.add_options) program.add_options(app);
  const std::optional<ParseStop> stop = app.Parse(argc, argv);
  if (!stop) return std::nullopt;
  return stop->exit_code == 0 ? 0 : Complain(program, kUsage, stop->error);
}

}  // namespace

int RunAgentProgram(int argc, char** argv, const AgentProgram& program) {
  std::signal(SIGPIPE, SIG_IGN);  // If the reader of the log exits, the agent must continue.
  ::umask(S_IRWXG | S_IRWXO);     // Only this user may read the robot's data.
  // The agent's memory holds its secret keys. Write no core file, and let only root read the memory.
  (void)::prctl(PR_SET_DUMPABLE, 0);
  Arguments arguments;
  if (auto exit_code = ReadCommandLine(argc, argv, program, arguments)) return *exit_code;
  const auto team = ReadTeamFile(arguments.team);
  if (!team) return Complain(program, kUsage, ToString(team.error()));
  const auto named = MemberNamed(team->config, arguments.agent);
  if (!named) return Complain(program, kUsage, ToString(named.error()));
  const bool logs_json = arguments.log_format == "json";
  const LogFormat format = logs_json ? LogFormat::kJson : LogFormat::kText;
  if (auto log = InitLog(arguments.log_level, arguments.agent, arguments.log_file, format); !log) {
    return Complain(program, kFailed, ToString(log.error()));
  }

  RaiseOpenFiles();
  GiveLargeBuffersBack();
  StopWaiter waiter;
  AgentOptions options = MakeOptions(arguments, program, waiter);
  auto folder = DataFolderOf(arguments, *team, **named);
  if (!folder) return Complain(program, kFailed, ToString(folder.error()));
  if (arguments.data_folder.empty() && folder->filename() != arguments.agent) {
    spdlog::info("the data stay in {}: a data folder belongs to an agent's id, not to its name", folder->string());
  }
  options.data_folder = *std::move(folder);
  if (program.make_actors) {
    auto actors = program.make_actors((*named)->id(), team->config);
    if (!actors) return Complain(program, kUsage, ToString(actors.error()));
    options.own_actors = *std::move(actors);
  }
  auto agent = Agent::Start(*team, std::move(options));
  if (!agent) return Complain(program, kFailed, arguments.agent + ": " + ToString(agent.error()));
  (*agent)->WriteTraceOnCrash();
  if (program.on_running) program.on_running(**agent);
  const std::string ready =
      arguments.agent + " of team " + team->config.team() + ", clients at " + (*agent)->client_endpoint();
  if (logs_json) {
    // With JSON logs, every line must be JSON, even if stdout and stderr are the same file.
    spdlog::info("is ready: {}", ready);
  } else {
    std::printf("ready: %s\n", ready.c_str());
    std::fflush(stdout);
  }
  NotifyService("READY=1");
  if (waiter.Wait() == kBeyondHelp) (*agent)->WriteTrace();
  spdlog::info("stopping");
  NotifyService("STOPPING=1");
  ::alarm(kStopSecondsMax);
  if (program.on_stopping) program.on_stopping();
  agent->reset();
  return waiter.exit_code();
}

}  // namespace moondb
