// RateLimitedLog: a line that a peer, or a disk that is full, can cause at will is logged at most once in a while, with
// how many were left out.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace moondb {

// One thread at a time.
class RateLimitedLog {
 public:
  explicit RateLimitedLog(std::chrono::seconds period = std::chrono::seconds(10)) : period_(period) {}

  void Warn(const std::string& text);
  void Error(const std::string& text);

 private:
  void Log(bool is_error, const std::string& text);

  std::chrono::seconds period_;
  std::chrono::steady_clock::time_point next_{};
  std::uint64_t left_out_ = 0;
};

}  // namespace moondb
