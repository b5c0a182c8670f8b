#include "runtime/mailbox.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "model/check.h"
#include "runtime/one_writer.h"

namespace moondb {
namespace {

void Add(const proto::RecordsStored& later, proto::RecordsStored& stored) {
  stored.set_last_row_id(std::max(stored.last_row_id(), later.last_row_id()));
  stored.set_is_pruned(stored.is_pruned() || later.is_pruned());
  for (const std::uint32_t type : later.data_types()) {
    const auto& known = stored.data_types();
    if (std::find(known.begin(), known.end(), type) == known.end()) stored.add_data_types(type);
  }
}

}  // namespace

Mailbox::Mailbox(const SpawnOptions& options)
    : limits_{options.messages_max, options.bytes_max},
      is_keyed_(options.overflow == Overflow::kLatestByKey),
      keyed_(options.key) {
  Check(limits_.messages >= 1, "a mailbox holds at least one message");
  Check(!is_keyed_ || options.key != nullptr, "kLatestByKey says what the key is");
}

// --- Thread-safe functions ---

Mailbox::Pushed Mailbox::Push(Item&& item) {
  const Pushed pushed = TryPush(item);
  if (pushed.result == SendResult::kFull) {
    const std::lock_guard lock(lock_);
    ++dropped_;
  }
  return pushed;
}

Mailbox::Pushed Mailbox::TryPush(Item& item) {
  const bool is_control = IsControl(*item.message);
  const bool is_stored = item.message->has_records_stored();
  item.is_past_bounds = item.is_timer || is_stored;
  const std::string key = is_keyed_ && !is_control && !item.is_timer ? keyed_.KeyOf(*item.message) : std::string();
  const std::lock_guard lock(lock_);
  if (is_closed_) return {SendResult::kUnreachable};
  const SendResult result = is_control    ? PushControl(item)
                            : is_stored   ? PushStored(item)
                            : key.empty() ? PushData(item)
                                          : PushKeyed(item, key);
  return {result, result == SendResult::kAccepted && std::exchange(is_reader_away_, false)};
}

bool Mailbox::Nudge() {
  const std::lock_guard lock(lock_);
  is_nudged_ = true;
  return std::exchange(is_reader_away_, false);
}

Mailbox::Counts Mailbox::counts() const {
  const std::lock_guard lock(lock_);
  const Totals taken = taken_.totals();
  Counts counts;
  counts.waiting = pushed_.items - taken.items;
  counts.waiting_max = waiting_max_;
  counts.bytes = pushed_.bytes - taken.bytes;
  counts.bytes_max = bytes_max_;
  counts.dropped = dropped_;
  counts.replaced = replaced_;
  return counts;
}

bool Mailbox::is_half_free() const {
  const std::lock_guard lock(lock_);
  const Totals taken = taken_.totals();
  return pushed_.messages - taken.messages <= limits_.messages / 2 && pushed_.bytes - taken.bytes <= limits_.bytes / 2;
}

// --- Functions that require lock_ to be held ---

SendResult Mailbox::PushControl(Item& item) {
  if (control_.size() >= kControlMessagesMax) {
    const auto body = item.message->body_case();
    const auto newest = std::find_if(control_.rbegin(), control_.rend(),
                                     [body](const Item& waiting) { return waiting.message->body_case() == body; });
    if (newest == control_.rend() && !IsOfTopic(*item.message)) return SendResult::kFull;
    if (newest != control_.rend()) {
      ++dropped_;
      control_.erase(std::next(newest).base());
      --pushed_.items;
    }
  }
  control_.push_back(std::move(item));
  ++pushed_.items;
  RefreshTaken();
  waiting_max_ = std::max(waiting_max_, pushed_.items - seen_.items);
  has_control_.store(true, std::memory_order_relaxed);
  return SendResult::kAccepted;
}

SendResult Mailbox::PushKeyed(Item& item, const std::string& key) {
  Item* waiting = keyed_.Find(key);
  if (waiting == nullptr) {
    if (PushData(item) != SendResult::kAccepted) return SendResult::kFull;
    keyed_.SetKeyOfNewest(key);
    return SendResult::kAccepted;
  }
  if (item.bytes > waiting->bytes && !HasRoomInBytes(item.bytes - waiting->bytes)) return SendResult::kFull;
  pushed_.bytes += item.bytes - waiting->bytes;
  bytes_max_ = std::max(bytes_max_, pushed_.bytes - taken_.totals().bytes);
  item.key = waiting->key;
  std::swap(*waiting, item);  // The caller frees the replaced message after it releases the lock.
  ++replaced_;
  return SendResult::kAccepted;
}

SendResult Mailbox::PushStored(Item& item) {
  if (stored_place_) {
    Item& waiting = is_keyed_ ? keyed_.at(*stored_place_) : pushed_items_[*stored_place_];
    Add(item.message->records_stored(), *waiting.message->mutable_records_stored());
    ++replaced_;
    return SendResult::kAccepted;
  }
  const std::uint64_t place = is_keyed_ ? keyed_.next_place() : pushed_items_.size();
  const SendResult result = PushData(item);
  stored_place_ = place;
  return result;
}

SendResult Mailbox::PushData(Item& item) {
  if (item.is_past_bounds) {
    item.bytes = 0;
  } else if (!HasRoom(item)) {
    return SendResult::kFull;
  }
  // Count after the insertion, because the insertion may throw bad_alloc.
  Count(is_keyed_ ? keyed_.Add(std::move(item)) : pushed_items_.emplace_back(std::move(item)));
  return SendResult::kAccepted;
}

bool Mailbox::HasRoom(const Item& item) {
  const std::uint64_t bytes_max = item.is_from_outside ? limits_.bytes / 4 : limits_.bytes;
  const std::uint64_t messages_max = item.is_from_outside ? limits_.messages - limits_.messages / 4 : limits_.messages;
  const auto fits = [&] {
    return pushed_.messages - seen_.messages < messages_max && FitsInBytes(item.bytes, bytes_max);
  };
  if (fits()) return true;
  RefreshTaken();
  return fits();
}

bool Mailbox::HasRoomInBytes(std::size_t bytes) {
  RefreshTaken();
  return FitsInBytes(bytes, limits_.bytes);
}

bool Mailbox::FitsInBytes(std::size_t bytes, std::uint64_t bytes_max) const {
  // `waiting` may exceed bytes_max: an empty lane accepts a message of any size, and bytes_max is lower for messages
  // from other agents and from clients with keys.
  const std::uint64_t waiting = pushed_.bytes - seen_.bytes;
  return waiting == 0 || (waiting < bytes_max && bytes <= bytes_max - waiting);
}

void Mailbox::RefreshTaken() { seen_ = taken_.totals(); }

void Mailbox::Count(const Item& item) {
  ++pushed_.items;
  pushed_.bytes += item.bytes;
  if (!item.is_past_bounds) ++pushed_.messages;
  // Read the reader's counters, which are on another cache line, only if there may be a new maximum.
  if (pushed_.items - seen_.items <= waiting_max_ && pushed_.bytes - seen_.bytes <= bytes_max_) return;
  RefreshTaken();
  waiting_max_ = std::max(waiting_max_, pushed_.items - seen_.items);
  bytes_max_ = std::max(bytes_max_, pushed_.bytes - seen_.bytes);
}

Mailbox::Item* Mailbox::TakeControl() {
  single_ = std::move(control_.front());
  control_.pop_front();
  if (control_.empty()) has_control_.store(false, std::memory_order_relaxed);
  taken_.CountControl();
  return &single_;
}

Mailbox::Item* Mailbox::TakeKeyed() {
  std::uint64_t place = 0;
  if (!keyed_.Take(single_, place)) return nullptr;
  if (stored_place_ == place) stored_place_.reset();
  taken_.Count(single_);
  return &single_;
}

// --- Functions of the reader ---

Mailbox::Item* Mailbox::Take() {
  if (must_look() || has_control_.load(std::memory_order_relaxed)) {
    if (must_look()) {
      items_.clear();
      next_ = 0;
    }
    const std::lock_guard lock(lock_);
    if (has_control_.load(std::memory_order_relaxed)) return TakeControl();
    if (is_keyed_) return TakeKeyed();
    if (items_.empty()) {
      items_.swap(pushed_items_);
      stored_place_.reset();
    }
    if (items_.empty()) return nullptr;
  }
  Item& item = items_[next_++];
  taken_.Count(item);
  // Prefetch the next message, which another core may have written, while this one is handled.
  if (!must_look()) __builtin_prefetch(&*items_[next_].message);
  return &item;
}

bool Mailbox::GoAway(bool for_messages) {
  const std::lock_guard lock(lock_);
  if (std::exchange(is_nudged_, false)) return false;
  if (for_messages && pushed_.items != taken_.items()) return false;
  is_reader_away_ = true;
  return true;
}

void Mailbox::Close() {
  std::vector<Item> pushed;  // Destroyed after the lock is released, because messages may be large.
  std::deque<Item> control;
  std::deque<Item> keyed;
  {
    const std::lock_guard lock(lock_);
    is_closed_ = true;
    pushed.swap(pushed_items_);
    control.swap(control_);
    keyed = keyed_.Clear();
    has_control_.store(false, std::memory_order_relaxed);
    stored_place_.reset();
    taken_.Set(pushed_);
  }
  items_.erase(items_.begin() + static_cast<std::ptrdiff_t>(next_), items_.end());
}

// --- Mailbox::Taken ---

Mailbox::Totals Mailbox::Taken::totals() const {
  return {items(), messages_.load(std::memory_order_relaxed), bytes_.load(std::memory_order_relaxed)};
}

void Mailbox::Taken::Count(const Item& item) {
  Increase(items_, 1);
  Increase(bytes_, item.bytes);
  if (!item.is_past_bounds) Increase(messages_, 1);
}

void Mailbox::Taken::CountControl() { Increase(items_, 1); }

void Mailbox::Taken::Set(const Totals& totals) {
  items_.store(totals.items, std::memory_order_relaxed);
  messages_.store(totals.messages, std::memory_order_relaxed);
  bytes_.store(totals.bytes, std::memory_order_relaxed);
}

// --- Mailbox::KeyedItems ---

// Returns an empty key if the user's key function throws. The exception must not reach the sender or the transport.
std::string Mailbox::KeyedItems::KeyOf(const proto::Message& message) const {
  try {
    return key_(message);
  } catch (...) {
    return {};
  }
}

Mailbox::Item* Mailbox::KeyedItems::Find(const std::string& key) {
  const auto found = place_of_.find(key);
  return found == place_of_.end() ? nullptr : &at(found->second);
}

void Mailbox::KeyedItems::SetKeyOfNewest(const std::string& key) {
  items_.back().key = &place_of_.emplace(key, next_place() - 1).first->first;
}

bool Mailbox::KeyedItems::Take(Item& item, std::uint64_t& place) {
  if (items_.empty()) return false;
  item = std::move(items_.front());
  items_.pop_front();
  if (item.key != nullptr) place_of_.erase(place_of_.find(*std::exchange(item.key, nullptr)));
  place = taken_++;
  return true;
}

std::deque<Mailbox::Item> Mailbox::KeyedItems::Clear() {
  place_of_.clear();
  return std::exchange(items_, {});
}

}  // namespace moondb
