#include "apps/moondb_sim/budget_checker.h"

namespace moondb::simulation {
namespace {

constexpr Duration kWindow = std::chrono::minutes(1);

}  // namespace

std::optional<std::string> BudgetChecker::OnBatch(std::size_t bytes, MonotonicTime now) {
  batches_.emplace_back(now, bytes);
  bytes_ += bytes;
  while (now - batches_.front().first > kWindow) {
    bytes_ -= batches_.front().second;
    batches_.pop_front();
  }
  const double bytes_max = bytes_per_second_ * std::chrono::duration<double>(kWindow).count() + burst_bytes_;
  if (static_cast<double>(bytes_) <= bytes_max) return std::nullopt;
  return std::to_string(bytes_) + " bytes in a minute, where " + std::to_string(static_cast<std::size_t>(bytes_max)) +
         " are allowed";
}

}  // namespace moondb::simulation
