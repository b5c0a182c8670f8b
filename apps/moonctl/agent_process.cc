#include "apps/moonctl/agent_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <thread>

extern char** environ;

namespace moondb {
namespace {

constexpr std::int64_t kTailBytes = 4096;
constexpr std::chrono::milliseconds kPollPeriod(20);

class SpawnSettings {
 public:
  explicit SpawnSettings(int log) {
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, log, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, log, STDERR_FILENO);
    // Open stdin last: if stdin was closed, `log` is descriptor 0.
    ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawnattr_init(&attributes);
    sigset_t none;
    sigemptyset(&none);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    sigset_t defaults;
    sigemptyset(&defaults);
    sigaddset(&defaults, SIGPIPE);
    ::posix_spawnattr_setsigdefault(&attributes, &defaults);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~SpawnSettings() {
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

}  // namespace

Result<pid_t> StartProcess(const std::vector<std::string>& command, const std::filesystem::path& log) {
  // Open the log in the parent, so that an unusable log and a program that cannot be started cause different errors.
  const int log_file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (log_file < 0)
    return Fail(ErrorCode::kInternal, std::string("cannot open: ") + std::strerror(errno), log.string());
  const SpawnSettings settings(log_file);
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int error = ::posix_spawn(&child, command.front().c_str(), &settings.actions, &settings.attributes,
                                  arguments.data(), environ);
  ::close(log_file);
  if (error != 0)
    return Fail(ErrorCode::kInternal, std::string("cannot start: ") + std::strerror(error), command.front());
  return child;
}

bool WaitUntil(SteadyClock::time_point deadline, const std::function<bool()>& condition) {
  while (!condition()) {
    if (SteadyClock::now() >= deadline) return false;
    std::this_thread::sleep_for(kPollPeriod);
  }
  return true;
}

bool HasEnded(pid_t child) { return ::waitpid(child, nullptr, WNOHANG) == child; }

std::string LastLine(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return "";
  const std::int64_t size = ::lseek(descriptor, 0, SEEK_END);
  std::string tail(static_cast<std::size_t>(std::min(size, kTailBytes)), '\0');
  const ssize_t length = ::pread(descriptor, tail.data(), tail.size(), size - static_cast<std::int64_t>(tail.size()));
  ::close(descriptor);
  tail.resize(static_cast<std::size_t>(std::max<ssize_t>(length, 0)));
  const std::size_t end = tail.find_last_not_of("\n\r \t");
  if (end == std::string::npos) return "";
  tail.resize(end + 1);
  const std::size_t begin = tail.find_last_of('\n');
  return begin == std::string::npos ? tail : tail.substr(begin + 1);
}

}  // namespace moondb
