// RateLimitedLog: limits the rate of a log line that a peer, a client or a full disk can cause repeatedly. Each line
// reports how many lines were suppressed before it. tools/check_logs lists every other log line of actors/ and
// runtime/, with the reason why its rate needs no limit.
#pragma once

#include <spdlog/common.h>

#include <chrono>
#include <cstdint>
#include <string>

namespace moondb {

// Not thread-safe.
class RateLimitedLog {
 public:
  static constexpr std::chrono::seconds kPeriod{10};

  // Allows a burst of `at_once` lines, then one line per kPeriod.
  explicit RateLimitedLog(int at_once = 1) : at_once_(at_once) {}

  void Info(const std::string& text) { Log(spdlog::level::info, text); }
  void Warn(const std::string& text) { Log(spdlog::level::warn, text); }
  void Error(const std::string& text) { Log(spdlog::level::err, text); }

 private:
  void Log(spdlog::level::level_enum level, const std::string& text);

  const int at_once_;
  std::chrono::steady_clock::time_point next_{};  // The next line is allowed (at_once_ - 1) * kPeriod before this time.
  std::uint64_t left_out_ = 0;
};

}  // namespace moondb
