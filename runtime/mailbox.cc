#include "runtime/mailbox.h"

#include <algorithm>
#include <utility>

#include "model/check.h"

namespace moondb {

Mailbox::Mailbox(const SpawnOptions& options)
    : messages_limit_(options.messages_max),
      bytes_limit_(options.bytes_max),
      key_(options.overflow == Overflow::kLatestByKey ? options.key : nullptr) {
  Check(messages_limit_ >= 1, "a mailbox holds at least one message");
  Check(options.overflow != Overflow::kLatestByKey || options.key != nullptr, "kLatestByKey says what the key is");
}

SendResult Mailbox::Push(Item item) {
  if (IsControl(*item.message)) return PushControl(std::move(item));
  std::string key;
  if (key_) key = key_(*item.message);
  const auto same = key.empty() ? place_of_.end() : place_of_.find(key);
  if (same != place_of_.end()) {
    Item& waiting = data_[same->second - taken_];
    // The newer one may be larger; it is taken all the same, since refusing it would leave the reader with the older.
    bytes_ += item.bytes - waiting.bytes;
    bytes_max_ = std::max(bytes_max_, bytes_);
    waiting = std::move(item);
    ++replaced_;
    return SendResult::kAccepted;
  }
  if (!item.is_timer && !HasRoom(item.bytes)) {
    ++dropped_;
    return SendResult::kFull;
  }
  if (!key.empty()) place_of_.emplace(std::move(key), taken_ + data_.size());
  Append(std::move(item));
  return SendResult::kAccepted;
}

SendResult Mailbox::PushControl(Item item) {
  if (control_.size() >= kControlMessagesMax) {
    const auto body = item.message->body_case();
    const auto newest = std::find_if(control_.rbegin(), control_.rend(),
                                     [body](const Item& waiting) { return waiting.message->body_case() == body; });
    ++dropped_;
    if (newest == control_.rend()) return SendResult::kFull;
    control_.erase(std::next(newest).base());
  }
  control_.push_back(std::move(item));
  size_max_ = std::max(size_max_, size());
  return SendResult::kAccepted;
}

bool Mailbox::HasRoom(std::size_t bytes) const {
  if (data_.size() - timer_count_ >= messages_limit_) return false;
  // bytes_ may lie above the limit while one larger message waits alone.
  return bytes_ == 0 || (bytes_ < bytes_limit_ && bytes <= bytes_limit_ - bytes_);
}

void Mailbox::Append(Item item) {
  if (item.is_timer) {
    item.bytes = 0;
    ++timer_count_;
  }
  bytes_ += item.bytes;
  data_.push_back(std::move(item));
  size_max_ = std::max(size_max_, size());
  bytes_max_ = std::max(bytes_max_, bytes_);
}

std::optional<Mailbox::Item> Mailbox::Pop() {
  if (control_.empty()) return data_.empty() ? std::nullopt : std::optional(TakeFront());
  Item item = std::move(control_.front());
  control_.pop_front();
  return item;
}

void Mailbox::Take(bool one_by_one, std::vector<Item>* batch) {
  if (!control_.empty()) {
    std::move(control_.begin(), control_.end(), std::back_inserter(*batch));
    control_.clear();
    return;
  }
  const std::size_t count = one_by_one || key_ ? 1 : kBatchMessages;
  if (data_.size() <= count && bytes_ <= kBatchBytes && !key_) return TakeAllData(batch);
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < count && !data_.empty(); ++i) {
    bytes += data_.front().bytes;
    if (i > 0 && bytes > kBatchBytes) return;
    batch->push_back(TakeFront());
  }
}

void Mailbox::TakeAllData(std::vector<Item>* batch) {
  taken_ += data_.size();
  timer_count_ = 0;
  bytes_ = 0;
  data_.MoveAllTo(batch);
}

Mailbox::Item Mailbox::TakeFront() {
  Item item = data_.pop_front();
  if (key_) {
    const auto same = place_of_.find(key_(*item.message));
    if (same != place_of_.end() && same->second == taken_) place_of_.erase(same);
  }
  ++taken_;
  if (item.is_timer) --timer_count_;
  bytes_ -= item.bytes;
  return item;
}

void Mailbox::PutBack(std::vector<Item>* batch, std::size_t first) {
  for (std::size_t i = batch->size(); i > first; --i) {
    Item& item = (*batch)[i - 1];
    if (IsControl(*item.message)) {
      control_.push_front(std::move(item));
      continue;
    }
    if (item.is_timer) ++timer_count_;
    bytes_ += item.bytes;
    data_.push_front(std::move(item));
    --taken_;
  }
  batch->resize(std::min(first, batch->size()));
}

void Mailbox::Clear() {
  taken_ += data_.size();
  control_.clear();
  data_.clear();
  place_of_.clear();
  timer_count_ = 0;
  bytes_ = 0;
}

bool Mailbox::is_half_free() const {
  return data_.size() - timer_count_ <= messages_limit_ / 2 && bytes_ <= bytes_limit_ / 2;
}

}  // namespace moondb
