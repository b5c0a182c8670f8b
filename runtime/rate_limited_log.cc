#include "runtime/rate_limited_log.h"

#include <spdlog/spdlog.h>

#include <algorithm>

namespace moondb {

void RateLimitedLog::Log(spdlog::level::level_enum level, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (now + kPeriod * (at_once_ - 1) < next_) {
    ++left_out_;
    return;
  }
  next_ = std::max(next_, now) + kPeriod;
  if (left_out_ > 0) {
    spdlog::log(level, "{} (and {} more like it before)", text, left_out_);
  } else {
    spdlog::log(level, "{}", text);
  }
  left_out_ = 0;
}

}  // namespace moondb
