// Runs a program on a pseudo terminal.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace moondb {

class Terminal {
 public:
  // Starts `command` with the test's environment plus `environment`.
  Terminal(std::vector<std::string> command, const std::map<std::string, std::string>& environment);
  ~Terminal();  // Kills the program if it still runs.
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  // Waits until the output contains `text` at least `count` times, for at most 30 s. Returns all output so far.
  const std::string& ShownUntil(const std::string& text, int count = 1);
  void Type(const std::string& keys) const;  // "\x03" is Ctrl-C.
  // Reads until the program ends and returns its exit code. Returns -1 if a signal ended it or 30 s passed.
  int Wait();

 private:
  bool Read(std::chrono::steady_clock::time_point deadline);  // Returns false at the end of output.

  int master_ = -1;
  pid_t pid_ = -1;
  std::string shown_;
};

}  // namespace moondb
