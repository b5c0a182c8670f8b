#include "bench/tally.h"

#include <chrono>
#include <utility>

namespace moondb {
namespace {

constexpr std::chrono::minutes kPatience(2);

}  // namespace

Tally::Tally(int sender_count, std::uint64_t per_sender)
    : total_(static_cast<std::uint64_t>(sender_count) * per_sender) {
  for (int sender = 0; sender < sender_count; ++sender) next_id_.push_back(IdOf(sender, 0));
}

void Tally::Finish() {
  const std::lock_guard lock(mutex_);
  is_finished_ = true;
  changed_.notify_all();
}

void Tally::Fail(std::string reason) {
  const std::lock_guard lock(mutex_);
  if (failure_.empty()) failure_ = std::move(reason);
  changed_.notify_all();
}

Result<void> Tally::Wait() {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, kPatience, [this] { return is_finished_ || !failure_.empty(); })) {
    failure_ = "messages were lost: not finished within two minutes";
  }
  if (!failure_.empty()) return tl::unexpected(Error{ErrorCode::kUnavailable, failure_, {}});
  return {};
}

}  // namespace moondb
