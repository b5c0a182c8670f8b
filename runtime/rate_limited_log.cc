#include "runtime/rate_limited_log.h"

#include <spdlog/spdlog.h>

namespace moondb {

void RateLimitedLog::Warn(const std::string& text) { Log(/*is_error=*/false, text); }

void RateLimitedLog::Error(const std::string& text) { Log(/*is_error=*/true, text); }

void RateLimitedLog::Log(bool is_error, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) {
    ++left_out_;
    return;
  }
  next_ = now + period_;
  const auto level = is_error ? spdlog::level::err : spdlog::level::warn;
  if (left_out_ > 0) {
    spdlog::log(level, "{} (and {} more like it before)", text, left_out_);
  } else {
    spdlog::log(level, "{}", text);
  }
  left_out_ = 0;
}

}  // namespace moondb
