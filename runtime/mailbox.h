// Mailbox: the messages that wait for one actor, bounded in number and bytes, in the order in which they came; control
// messages before data.
//
// Not thread-safe: its owner guards it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "runtime/actor.h"
#include "runtime/fifo.h"

namespace moondb {

class Mailbox {
 public:
  struct Item {
    MessagePtr message;
    const Address* sender = nullptr;     // Outlives the item; null: the envelope says who it is.
    std::size_t bytes = 0;               // Towards the bound, as serialised.
    std::uint64_t incarnation = 0;       // Of the actor whose timer this is.
    std::uint16_t sender_name = 0xFFFF;  // In traces; 0xFFFF: not one of this agent's actors.
    bool is_timer = false;               // Past the bounds.
  };

  // Items of one batch count no longer towards the bounds: at most so many messages and, if more than one, bytes.
  static constexpr std::size_t kBatchMessages = 64;
  static constexpr std::size_t kBatchBytes = 64 * 1024;

  explicit Mailbox(const SpawnOptions& options);

  // To the lane that IsControl says. kAccepted, or kFull: dropped and counted. A message larger than bytes_max is taken
  // when no other counts towards the bytes.
  SendResult Push(Item item);

  // The next message, if any.
  std::optional<Item> Pop();
  // The next messages: the control messages alone if there are any, else a batch of data. Of a kLatestByKey mailbox
  // and of `one_by_one` a single one: what is in a batch can be replaced no more. `batch` is empty.
  void Take(bool one_by_one, std::vector<Item>* batch);
  // Items of a batch from `first` on were not handled: back to where they were.
  void PutBack(std::vector<Item>* batch, std::size_t first);

  // Whether Push would take a data message of so many bytes, no key considered.
  bool HasRoom(std::size_t bytes) const;

  void Clear();  // Not counted as dropped.

  bool empty() const { return control_.empty() && data_.empty(); }
  bool has_control() const { return !control_.empty(); }
  // Whether a kBlock sender that found no room should try again: half of the bound is free.
  bool is_half_free() const;
  std::size_t size() const { return control_.size() + data_.size(); }
  std::size_t bytes() const { return bytes_; }
  std::size_t size_max() const { return size_max_; }    // The most that ever waited.
  std::size_t bytes_max() const { return bytes_max_; }  // Likewise.
  std::uint64_t dropped() const { return dropped_; }
  std::uint64_t replaced() const { return replaced_; }

 private:
  SendResult PushControl(Item item);
  void Append(Item item);
  Item TakeFront();
  void TakeAllData(std::vector<Item>* batch);

  const std::size_t messages_limit_;
  const std::size_t bytes_limit_;
  const std::function<std::string(const proto::Message&)> key_;  // Empty: not kLatestByKey.

  std::deque<Item> control_;
  Fifo<Item> data_;
  std::uint64_t taken_ = 0;                                  // Items that ever left the front of data_.
  std::unordered_map<std::string, std::uint64_t> place_of_;  // Key to the waiting item: taken_ + index.
  std::size_t timer_count_ = 0;                              // Of data_.
  std::size_t bytes_ = 0;
  std::size_t size_max_ = 0;
  std::size_t bytes_max_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint64_t replaced_ = 0;
};

}  // namespace moondb
