#include "tests/apps/terminal.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace moondb {
namespace {

constexpr std::chrono::seconds kLimit(30);

std::chrono::steady_clock::time_point Deadline() { return std::chrono::steady_clock::now() + kLimit; }

int CountOf(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace

Terminal::Terminal(std::vector<std::string> command, const std::map<std::string, std::string>& environment) {
  std::vector<char*> pointers;
  for (std::string& word : command) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  pid_ = ::forkpty(&master_, nullptr, nullptr, nullptr);
  if (pid_ < 0) ADD_FAILURE() << "no pseudo-terminal: " << std::strerror(errno);
  if (pid_ != 0) return;
  for (const auto& [name, value] : environment) ::setenv(name.c_str(), value.c_str(), 1);
  ::execv(pointers[0], pointers.data());
  ::_exit(127);
}

Terminal::~Terminal() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (master_ >= 0) ::close(master_);
}

bool Terminal::Read(std::chrono::steady_clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
  pollfd ready{master_, POLLIN, 0};
  if (left.count() <= 0 || ::poll(&ready, 1, static_cast<int>(left.count())) <= 0) return false;
  char bytes[4096];
  const ssize_t count = ::read(master_, bytes, sizeof(bytes));
  if (count > 0) shown_.append(bytes, static_cast<std::size_t>(count));
  return count > 0;
}

const std::string& Terminal::ShownUntil(const std::string& text, int count) {
  const auto deadline = Deadline();
  while (CountOf(shown_, text) < count && Read(deadline)) {
  }
  return shown_;
}

void Terminal::Type(const std::string& keys) const {
  if (::write(master_, keys.data(), keys.size()) < 0) ::perror("typing");
}

int Terminal::Wait() {
  if (pid_ < 0) return -1;  // kill(-1, ...) would end every process.
  const auto deadline = Deadline();
  while (Read(deadline)) {
  }
  if (std::chrono::steady_clock::now() >= deadline) ::kill(pid_, SIGKILL);
  int status = 0;
  ::waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace moondb
