#include "runtime/mailbox.h"

#include <algorithm>
#include <utility>

#include "model/check.h"

namespace moondb {

Mailbox::Mailbox(const SpawnOptions& options) : messages_limit_(options.messages_max), bytes_limit_(options.bytes_max) {
  Check(messages_limit_ >= 1, "a mailbox holds at least one message");
}

bool Mailbox::Push(MessagePtr message, std::size_t bytes) {
  const bool has_room = items_.size() - system_count_ < messages_limit_;
  // bytes_ may lie above the limit while one larger message waits alone.
  const bool fits = bytes_ == 0 || (bytes_ < bytes_limit_ && bytes <= bytes_limit_ - bytes_);
  if (!has_room || !fits) {
    ++dropped_;
    return false;
  }
  bytes_ += bytes;
  Append({std::move(message), bytes, /*is_system=*/false, /*incarnation=*/0});
  return true;
}

void Mailbox::PushSystem(MessagePtr message, std::uint64_t incarnation) {
  ++system_count_;
  Append({std::move(message), /*bytes=*/0, /*is_system=*/true, incarnation});
}

void Mailbox::Append(Item item) {
  items_.push_back(std::move(item));
  size_max_ = std::max(size_max_, items_.size());
}

std::optional<Mailbox::Item> Mailbox::Pop() {
  if (items_.empty()) return std::nullopt;
  Item item = std::move(items_.front());
  items_.pop_front();
  if (item.is_system) --system_count_;
  bytes_ -= item.bytes;
  return item;
}

void Mailbox::Clear() {
  items_.clear();
  system_count_ = 0;
  bytes_ = 0;
}

}  // namespace moondb
