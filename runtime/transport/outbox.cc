#include "runtime/transport/outbox.h"

#include <algorithm>
#include <utility>

#include "model/check.h"

namespace moondb {

bool Outbox::HasRoomFor(const Entry& entry) const {
  if (empty()) return true;
  if (messages_ < options_.messages_max && bytes_ + entry.frame.size() <= options_.bytes_max) return true;
  return entry.outbound_class == kControlClass && control_messages_ < options_.reserve_messages &&
         control_bytes_ + entry.frame.size() <= options_.reserve_bytes;
}

void Outbox::CountIn(const Entry& entry) {
  messages_ += entry.messages;
  bytes_ += entry.frame.size();
  if (entry.outbound_class != kControlClass) return;
  control_messages_ += entry.messages;
  control_bytes_ += entry.frame.size();
}

void Outbox::CountOut(const Entry& entry) {
  messages_ -= entry.messages;
  bytes_ -= entry.frame.size();
  if (entry.outbound_class != kControlClass) return;
  control_messages_ -= entry.messages;
  control_bytes_ -= entry.frame.size();
}

// Returns the waiting entry with the class and key of `entry`, or null. Searches linearly: messages with a key are
// control messages, and few of them wait at a time.
Outbox::Entry* Outbox::FindWaiting(const Entry& entry) {
  if (entry.key.empty()) return nullptr;
  std::deque<Entry>& waiting = classes_[entry.outbound_class];
  const auto found = std::ranges::find(waiting, entry.key, &Entry::key);
  return found == waiting.end() ? nullptr : &*found;
}

// Returns the last waiting frame of the class if the entry may be appended to it, otherwise null. Appending to an
// earlier frame would change the order of messages.
Outbox::Entry* Outbox::FrameToShare(const Entry& entry) {
  std::deque<Entry>& waiting = classes_[entry.outbound_class];
  if (waiting.empty() || !entry.key.empty() || !waiting.back().key.empty()) return nullptr;
  return waiting.back().frame.size() + entry.frame.size() <= shared_frame_bytes_max_ ? &waiting.back() : nullptr;
}

SendResult Outbox::Push(Entry&& entry) {
  Check(entry.outbound_class < kOutboundClasses, "an outbox knows the class");
  if (Entry* waiting = FindWaiting(entry)) {
    CountOut(*waiting);
    CountIn(entry);
    *waiting = std::move(entry);
    ++replaced_;
    return SendResult::kAccepted;
  }
  if (!HasRoomFor(entry)) return SendResult::kFull;
  if (Entry* shared = FrameToShare(entry)) {
    shared->frame += entry.frame;
    shared->messages += entry.messages;
    CountIn(entry);
  } else {
    classes_[entry.outbound_class].push_back(std::move(entry));
    CountIn(classes_[entry.outbound_class].back());
  }
  return SendResult::kAccepted;
}

const Outbox::Entry* Outbox::Front() const {
  for (const std::deque<Entry>& waiting : classes_) {
    if (!waiting.empty()) return &waiting.front();
  }
  return nullptr;
}

Outbox::Entry* Outbox::Front() { return const_cast<Entry*>(std::as_const(*this).Front()); }

void Outbox::PopFront() {
  const Entry* front = Front();
  Check(front != nullptr, "an outbox that something is taken from is not empty");
  CountOut(*front);
  classes_[front->outbound_class].pop_front();
}

std::size_t Outbox::Clear() {
  const std::size_t dropped = messages_;
  for (std::deque<Entry>& waiting : classes_) waiting.clear();
  messages_ = 0;
  bytes_ = 0;
  control_messages_ = 0;
  control_bytes_ = 0;
  return dropped;
}

}  // namespace moondb
