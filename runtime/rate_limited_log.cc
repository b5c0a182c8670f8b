#include "runtime/rate_limited_log.h"

#include <spdlog/spdlog.h>

namespace moondb {

void RateLimitedLog::Warn(const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) {
    ++left_out_;
    return;
  }
  next_ = now + period_;
  if (left_out_ > 0) {
    spdlog::warn("{} (and {} more like it before)", text, left_out_);
  } else {
    spdlog::warn("{}", text);
  }
  left_out_ = 0;
}

}  // namespace moondb
