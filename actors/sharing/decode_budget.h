// DecodeBudget: limits the decoded bytes of one sender's batches. A batch of a few hundred bytes can decode to 18 MiB,
// so a sender that repeats such batches could use up the processor.
//
// The budget is a token bucket of at most kAtOnceBytes decoded bytes. An empty bucket refills within a minute, and each
// coded byte that arrives adds kBytesPerCodedByte. Batches of an honest sender grow about 10 times when decoded, sparse
// maps about 100 times. Plain value.
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
  // Charge for a batch that does not decode. Its decoded size is unknown, and a few coded bytes can cost as much time
  // as a full batch.
  static constexpr std::size_t kDamagedBytes = 16 * 1024 * 1024;

  // Refills the budget for the time since the last call and for a batch of `coded_bytes`. Returns true if the batch may
  // be decoded.
  bool Takes(std::size_t coded_bytes, Time now) {
    const double minutes = std::chrono::duration<double, std::ratio<60>>(now - at_).count();
    const double earned = minutes * kAtOnceBytes + static_cast<double>(coded_bytes) * kBytesPerCodedByte;
    left_ = std::min(kAtOnceBytes, left_ + earned);
    at_ = now;
    return left_ > 0;
  }
  // Subtracts the size of a decoded batch from the budget.
  void Charge(std::size_t decoded_bytes) { left_ -= static_cast<double>(decoded_bytes); }

 private:
  double left_ = kAtOnceBytes;
  Time at_{};
};

}  // namespace moondb
