// A program on a pseudo terminal, as a person sees it.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace moondb {

class Terminal {
 public:
  // `environment` is added to the test's own.
  Terminal(std::vector<std::string> command, const std::map<std::string, std::string>& environment);
  ~Terminal();  // Ends it, if it still runs.
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  // All that was shown so far, once it holds `count` times `text`; what there is after 30 s.
  const std::string& ShownUntil(const std::string& text, int count = 1);
  void Type(const std::string& keys) const;  // "\x03" is Ctrl-C.
  // Reads on until the program ends: its exit code, -1 if a signal ended it or it ran on for 30 s.
  int Wait();

 private:
  bool Read(std::chrono::steady_clock::time_point deadline);  // False: nothing more comes.

  int master_ = -1;
  pid_t pid_ = -1;
  std::string shown_;
};

}  // namespace moondb
