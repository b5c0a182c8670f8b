// BudgetChecker: checks that an agent's sessions stay within the radio budget. It counts the bytes of the batches that
// the agent sends and receives.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "runtime/actor.h"

namespace moondb::simulation {

class BudgetChecker {
 public:
  // `burst_bytes` is the number of bytes that all sessions together may send in one burst after a pause.
  BudgetChecker(double bytes_per_second, double burst_bytes)
      : bytes_per_second_(bytes_per_second), burst_bytes_(burst_bytes) {}

  // Call when the agent sends or receives a batch of `bytes` bytes. Returns a description if the batches of the last
  // minute exceed the budget; null otherwise.
  std::optional<std::string> OnBatch(std::size_t bytes, MonotonicTime now);

 private:
  double bytes_per_second_;
  double burst_bytes_;
  std::deque<std::pair<MonotonicTime, std::size_t>> batches_;  // Time and bytes of each batch of the last minute.
  std::size_t bytes_ = 0;                                      // Sum of the bytes in `batches_`.
};

}  // namespace moondb::simulation
