#include "runtime/outbox.h"

#include <utility>

namespace moondb {

SendResult Outbox::Push(Entry entry) {
  const std::lock_guard lock(mutex_);
  if (!is_open_) return SendResult::kUnreachable;
  const bool is_full = entries_.size() >= frames_max_ || bytes_ + entry.frame.size() > bytes_max_;
  if (is_full && !entries_.empty()) return SendResult::kFull;
  bytes_ += entry.frame.size();
  entries_.push_back(std::move(entry));
  return SendResult::kAccepted;
}

bool Outbox::is_open() const {
  const std::lock_guard lock(mutex_);
  return is_open_;
}

bool Outbox::empty() const {
  const std::lock_guard lock(mutex_);
  return entries_.empty();
}

void Outbox::Open() {
  const std::lock_guard lock(mutex_);
  is_open_ = true;
}

std::size_t Outbox::Close() {
  const std::lock_guard lock(mutex_);
  is_open_ = false;
  const std::size_t dropped = entries_.size();
  entries_.clear();
  bytes_ = 0;
  return dropped;
}

const Outbox::Entry* Outbox::Front() const {
  const std::lock_guard lock(mutex_);
  // Pushing does not move a deque's elements, and only the caller's thread removes them.
  return entries_.empty() ? nullptr : &entries_.front();
}

void Outbox::PopFront() {
  const std::lock_guard lock(mutex_);
  bytes_ -= entries_.front().frame.size();
  entries_.pop_front();
}

}  // namespace moondb
