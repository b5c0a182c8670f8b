// Pacer: limits sent bytes to a rate, with a token bucket. The bucket holds at most `burst_bytes` and fills at the
// rate. Sending is allowed while the bucket is not empty, and may overdraw the bucket. The next send then waits until
// the bucket is no longer overdrawn. The caller passes the time with each call. Plain value.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace moondb {

class Pacer {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  explicit Pacer(std::size_t burst_bytes) : burst_bytes_(static_cast<double>(burst_bytes)), left_bytes_(burst_bytes_) {}

  // Sets the rate at which the bucket fills; 0: no limit.
  void SetRate(double bytes_per_second, Time now) {
    left_bytes_ = LeftBytes(now);
    at_ = now;
    bytes_per_second_ = bytes_per_second;
  }
  double rate() const { return bytes_per_second_; }

  void Spend(std::size_t bytes, Time now) {
    left_bytes_ = LeftBytes(now) - static_cast<double>(bytes);
    at_ = now;
  }

  // Returns the earliest time at which bytes may be sent; `now` if they may be sent immediately.
  Time Next(Time now) const {
    const double left_bytes = LeftBytes(now);
    if (left_bytes > 0) return now;
    const std::chrono::duration<double> wait(-left_bytes / bytes_per_second_);
    return now + std::chrono::duration_cast<Duration>(wait) + Duration(1);
  }

 private:
  double LeftBytes(Time now) const {
    if (bytes_per_second_ <= 0) return burst_bytes_;
    const double filled = std::chrono::duration<double>(now - at_).count() * bytes_per_second_;
    return std::min(burst_bytes_, left_bytes_ + filled);
  }

  double burst_bytes_;
  double left_bytes_;
  double bytes_per_second_ = 0;
  Time at_{};
};

}  // namespace moondb
