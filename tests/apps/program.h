// Runs programs for tests. Returns their exit code and output, and kills them after a time limit.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace moondb {

struct Outcome {
  int exit_code = -1;  // -1 if the process was killed or ended by a signal.
  std::string out;
  std::string error;
};

// A child process. The destructor kills it.
class Child {
 public:
  // Starts `command` with the test's environment plus `environment`. Writes the output to out.txt and error.txt in
  // `folder`.
  Child(std::vector<std::string> command, const std::map<std::string, std::string>& environment,
        std::filesystem::path folder);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  // Waits until the process ends. Kills the process if it still runs after `limit`.
  Outcome Wait(std::chrono::seconds limit = std::chrono::seconds(60));
  std::string Out() const;

 private:
  std::filesystem::path folder_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool has_ended_ = false;
};

}  // namespace moondb
