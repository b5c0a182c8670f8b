#include "tests/apps/program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <sstream>
#include <thread>

extern char** environ;

namespace moondb {
namespace {

std::string ReadAll(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::vector<char*> Pointers(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Child::Child(std::vector<std::string> command, const std::map<std::string, std::string>& environment,
             std::filesystem::path folder) {
  static std::atomic<int> count = 0;
  folder_ = folder / ("run" + std::to_string(++count));
  std::filesystem::create_directories(folder_);
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!environment.contains(text.substr(0, text.find('=')))) variables.push_back(text);
  }
  for (const auto& [name, value] : environment) variables.push_back(name + "=" + value);

  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  const std::string out = folder_ / "out.txt", error = folder_ / "error.txt";
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, error.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const std::string program = command.front();
  if (::posix_spawn(&pid_, program.c_str(), &actions, nullptr, Pointers(command).data(), Pointers(variables).data()) !=
      0) {
    pid_ = -1;
    has_ended_ = true;
    status_ = 127 << 8;
  }
  ::posix_spawn_file_actions_destroy(&actions);
}

Child::~Child() {
  if (!has_ended_) Wait(std::chrono::seconds(0));
}

void Child::Signal(int signal) const {
  if (!has_ended_) ::kill(pid_, signal);
}

Outcome Child::Wait(std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!has_ended_) {
    if (::waitpid(pid_, &status_, WNOHANG) == pid_) {
      has_ended_ = true;
    } else if (std::chrono::steady_clock::now() >= deadline) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, &status_, 0);
      has_ended_ = true;
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, Out(), ReadAll(folder_ / "error.txt")};
}

std::string Child::Out() const { return ReadAll(folder_ / "out.txt"); }

}  // namespace moondb
