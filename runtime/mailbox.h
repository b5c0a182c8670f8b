// Mailbox: the messages that wait for one actor. Control messages are taken before data messages, and each lane in
// order of arrival. The number and bytes of the messages are limited.
//
// Any thread pushes; one thread at a time, the reader, takes messages out. The lock is held for one push, or while the
// reader moves all newly pushed messages to its own batch. A reader without work calls GoAway. The first push after
// that returns must_call_reader, and the pushing thread must then schedule the reader.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "runtime/actor.h"
#include "runtime/owned_message.h"
#include "runtime/spin_lock.h"

namespace moondb {

class Mailbox {
 public:
  struct Item {
    OwnedMessage message = nullptr;
    const Address* sender = nullptr;     // Outlives the item. Null: the sender is in the message's envelope.
    std::size_t bytes = 0;               // Bytes that count towards the byte limit.
    std::uint32_t incarnation = 0;       // For a timer: the actor's incarnation that set it.
    std::uint16_t sender_name = 0xFFFF;  // Sender's name in traces; 0xFFFF: not an actor of this agent.
    bool is_timer = false;
    // True if another agent or a client with a key sent the message. Such a message is refused if all waiting bytes
    // would then exceed a quarter of the byte limit, or all waiting messages three quarters of their limit.
    bool is_from_outside = false;
    // Set by Push. True for a timer and for RecordsStored, which do not count towards the limits.
    bool is_past_bounds = false;
    const std::string* key = nullptr;  // Points to the key in the mailbox while the item waits under this key.
  };

  struct Pushed {
    SendResult result;
    bool must_call_reader = false;  // True if no reader was active (GoAway). The caller must then schedule one.
  };

  struct Counts {
    std::size_t waiting = 0;  // Messages on both lanes.
    std::size_t waiting_max = 0;
    std::size_t bytes = 0;  // Bytes on the data lane.
    std::size_t bytes_max = 0;
    std::uint64_t dropped = 0;
    std::uint64_t replaced = 0;
  };

  explicit Mailbox(const SpawnOptions& options);

  // --- Thread-safe functions ---

  // Adds an item to the control lane if IsControl(message), otherwise to the data lane. The result is kAccepted, kFull
  // (the item is dropped and counted), or kUnreachable after Close. On the data lane, a message larger than the byte
  // limit is accepted only if no waiting message counts towards that limit. A RecordsStored message is merged into a
  // RecordsStored that already waits.
  Pushed Push(Item&& item);
  // Adds the item like Push. An item that is not accepted stays unchanged and is not counted as dropped.
  Pushed TryPush(Item& item);
  // Makes the next GoAway return false, so that the reader checks for work other than messages. Returns true if no
  // reader is active (GoAway); the caller must then schedule one.
  bool Nudge();

  Counts counts() const;
  bool empty() const { return counts().waiting == 0; }
  // True if at most half of each limit is used. Senders that wait for room try again only then.
  bool is_half_free() const;

  // --- Functions of the reader ---

  // Returns the next message, or null if none waits. The item is valid until Take is called again. The reader owns the
  // item's message and should release it soon after handling it.
  Item* Take();
  // True if the next Take checks for newly pushed messages.
  bool must_look() const { return next_ == items_.size(); }
  // Ends the reader's activity and returns true. Returns false instead if there is work: Nudge was called, or
  // `for_messages` is true and messages wait. After GoAway returned true, another thread may already be the reader. A
  // new mailbox has no active reader.
  bool GoAway(bool for_messages);
  // Drops all waiting messages, without counting them as dropped, and refuses new ones.
  void Close();

 private:
  // Totals of the items that were ever pushed (pushed_) or ever taken (taken_).
  struct Totals {
    std::uint64_t items = 0;
    std::uint64_t messages = 0;  // Data messages that count towards the limits.
    std::uint64_t bytes = 0;     // Bytes of the data messages that count towards the limits.
  };

  // Totals of the items that the reader has taken. Only the reader writes them.
  class Taken {
   public:
    Totals totals() const;
    std::uint64_t items() const { return items_.load(std::memory_order_relaxed); }
    void Count(const Item& item);
    void CountControl();
    void Set(const Totals& totals);

   private:
    std::atomic<std::uint64_t> items_ = 0;
    std::atomic<std::uint64_t> messages_ = 0;
    std::atomic<std::uint64_t> bytes_ = 0;
  };

  // The data lane of a kLatestByKey mailbox. Items are taken one at a time, because an item that was taken can no
  // longer be replaced.
  class KeyedItems {
   public:
    explicit KeyedItems(std::function<std::string(const proto::Message&)> key) : key_(std::move(key)) {}

    // Returns the key of `message`. If the key is empty, the message replaces no other. Thread-safe; needs no lock.
    std::string KeyOf(const proto::Message& message) const;
    // Items get place numbers in the order in which they are added. `next_place` returns the number of the item that is
    // added next. `at` returns the waiting item with the number `place`.
    std::uint64_t next_place() const { return taken_ + items_.size(); }
    Item& at(std::uint64_t place) { return items_[place - taken_]; }
    Item& Add(Item&& item) { return items_.emplace_back(std::move(item)); }
    // Returns the item that waits under `key`, or null.
    Item* Find(const std::string& key);
    // Registers the newest item under `key`.
    void SetKeyOfNewest(const std::string& key);
    // Moves the oldest item to `item` and its place number to `place`. Returns false if no item waits.
    bool Take(Item& item, std::uint64_t& place);
    std::deque<Item> Clear();

   private:
    const std::function<std::string(const proto::Message&)> key_;
    std::deque<Item> items_;
    std::unordered_map<std::string, std::uint64_t> place_of_;  // Place numbers by key.
    std::uint64_t taken_ = 0;
  };

  struct Limits {
    std::uint64_t messages;
    std::uint64_t bytes;
  };

  // The functions from here on are called with lock_ held.
  SendResult PushControl(Item& item);
  SendResult PushKeyed(Item& item, const std::string& key);
  SendResult PushStored(Item& item);
  SendResult PushData(Item& item);
  bool HasRoom(const Item& item);
  bool HasRoomInBytes(std::size_t bytes);
  bool FitsInBytes(std::size_t bytes, std::uint64_t bytes_max) const;
  void RefreshTaken();
  void Count(const Item& item);
  Item* TakeControl();
  Item* TakeKeyed();

  const Limits limits_;
  const bool is_keyed_;  // True for Overflow::kLatestByKey.

  mutable SpinLock lock_;
  bool is_reader_away_ = true;
  bool is_nudged_ = false;
  bool is_closed_ = false;
  std::vector<Item> pushed_items_;  // Always empty if is_keyed_.
  Totals pushed_;
  Totals seen_;  // Older copy of taken_'s totals. If it shows enough room, senders need not read taken_'s cache line.
  std::uint64_t waiting_max_ = 0;
  std::uint64_t bytes_max_ = 0;

  // Written by the reader only, on a separate cache line. Senders may read taken_.
  alignas(64) std::vector<Item> items_;  // Batch moved here from pushed_items_. The items before next_ have been taken.
  std::size_t next_ = 0;
  Taken taken_;

  std::atomic<bool> has_control_ = false;

  // The members from here on are rarely used. lock_ guards all of them except single_.

  // Place of the waiting RecordsStored message: its index in pushed_items_, or its place number in keyed_ if is_keyed_.
  std::optional<std::uint64_t> stored_place_;
  std::deque<Item> control_;
  KeyedItems keyed_;
  std::uint64_t dropped_ = 0;
  std::uint64_t replaced_ = 0;
  Item single_;  // Item that the reader last took from control_ or keyed_.
};

}  // namespace moondb
