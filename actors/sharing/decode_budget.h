// DecodeBudget: what one sender's batches may become when they are decoded. A few hundred bytes can state 18 MiB; who
// sends such ones again and again would take the processor from all others.
//
// kAtOnceBytes at once, which come back within a minute, and kBytesPerCodedByte for each byte that is sent: honest
// batches become some ten times as large, sparse maps a hundred times. A plain value.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace moondb {

class DecodeBudget {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  static constexpr double kAtOnceBytes = 16.0 * 1024 * 1024;
  static constexpr double kBytesPerCodedByte = 100;
  // A batch that does not decode counts as this: what it cost is not known. Few bytes can cost as much as a full batch.
  static constexpr std::size_t kDamagedBytes = 16 * 1024 * 1024;

  // Whether the sender's next coded bytes are decoded.
  bool Takes(std::size_t coded_bytes, Time now) {
    const double minutes = std::chrono::duration<double, std::ratio<60>>(now - at_).count();
    const double earned = minutes * kAtOnceBytes + static_cast<double>(coded_bytes) * kBytesPerCodedByte;
    left_ = std::min(kAtOnceBytes, left_ + earned);
    at_ = now;
    return left_ > 0;
  }
  // What they became.
  void Charge(std::size_t decoded_bytes) { left_ -= static_cast<double>(decoded_bytes); }

 private:
  double left_ = kAtOnceBytes;
  Time at_{};
};

}  // namespace moondb
