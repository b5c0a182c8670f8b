// BudgetChecker: whether an agent's sessions keep to the radio's budget, as one knows it who hears all that the agent
// sends and is sent.
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
  // `burst_bytes`: what all its sessions may send at once after a rest.
  BudgetChecker(double bytes_per_second, double burst_bytes)
      : bytes_per_second_(bytes_per_second), burst_bytes_(burst_bytes) {}

  // A batch that the agent sends or is sent. What is wrong, if anything.
  std::optional<std::string> OnBatch(std::size_t bytes, MonotonicTime now);

 private:
  double bytes_per_second_;
  double burst_bytes_;
  std::deque<std::pair<MonotonicTime, std::size_t>> batches_;  // Of the last minute.
  std::size_t bytes_ = 0;                                      // In these.
};

}  // namespace moondb::simulation
