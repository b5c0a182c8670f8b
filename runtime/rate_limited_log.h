// RateLimitedLog: a line that a peer, a client, or a disk that is full, can cause at will is logged at most once in a
// while, with how many were left out. Every other line of actors/ and runtime/ stands in tools/check_logs with the
// reason why nobody else can cause it at will.
#pragma once

#include <spdlog/common.h>

#include <chrono>
#include <cstdint>
#include <string>

namespace moondb {

// One thread at a time.
class RateLimitedLog {
 public:
  static constexpr std::chrono::seconds kPeriod{10};

  // So many lines at once, then one in a period.
  explicit RateLimitedLog(int at_once = 1) : at_once_(at_once) {}

  void Info(const std::string& text) { Log(spdlog::level::info, text); }
  void Warn(const std::string& text) { Log(spdlog::level::warn, text); }
  void Error(const std::string& text) { Log(spdlog::level::err, text); }

 private:
  void Log(spdlog::level::level_enum level, const std::string& text);

  const int at_once_;
  std::chrono::steady_clock::time_point next_{};  // When the next line would come, were they spread evenly.
  std::uint64_t left_out_ = 0;
};

}  // namespace moondb
