// Mailbox: the messages that wait for one actor, bounded in number and bytes, in the order in which they came; control
// messages before data. Of RecordsStored one waits: what comes meanwhile is added to it.
//
// Any thread pushes; one thread at a time, the reader, takes. The senders' lock is held for one push, or while the
// reader takes over all that came since it last did. A reader without work goes away; the push that it has to be called
// back for says so, and no other.
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
    const Address* sender = nullptr;     // Outlives the item; null: the envelope says who it is.
    std::size_t bytes = 0;               // Towards the bound.
    std::uint32_t incarnation = 0;       // Of the actor whose timer this is.
    std::uint16_t sender_name = 0xFFFF;  // In traces; 0xFFFF: not one of this agent's actors.
    bool is_timer = false;
    bool is_from_outside = false;      // Of another agent or a client: these have a quarter of the bytes.
    bool is_past_bounds = false;       // A timer, or RecordsStored; set by the push.
    const std::string* key = nullptr;  // The mailbox's own, while the item waits under it.
  };

  struct Pushed {
    SendResult result;
    bool must_call_reader = false;  // It is away, and was not called yet.
  };

  struct Counts {
    std::size_t waiting = 0;  // On both lanes.
    std::size_t waiting_max = 0;
    std::size_t bytes = 0;  // On the data lane.
    std::size_t bytes_max = 0;
    std::uint64_t dropped = 0;
    std::uint64_t replaced = 0;
  };

  explicit Mailbox(const SpawnOptions& options);

  // --- Any thread ---

  // To the lane that IsControl says. kAccepted; kFull: dropped and counted; kUnreachable after Close. A message larger
  // than bytes_max is taken when no other counts towards the bytes.
  Pushed Push(Item&& item);
  // As Push, but `item` is left alone, and not counted, unless accepted.
  Pushed TryPush(Item& item);
  // The reader is to look for work that is not a message. Whether it has to be called back.
  bool Nudge();

  Counts counts() const;
  bool empty() const { return counts().waiting == 0; }
  // Whether a sender that found no room should try again: half of the bound is free.
  bool is_half_free() const;

  // --- The reader ---

  // The next message, or null. The item stays where it is until Take is called again; its message is the reader's, to
  // let go at once.
  Item* Take();
  // Take will look at what was pushed since it last did.
  bool must_look() const { return next_ == items_.size(); }
  // Goes away: true. False: it was nudged since, or `for_messages` and there are some. It is away from the beginning.
  // Once away, the mailbox may have another reader already.
  bool GoAway(bool for_messages);
  // Drops all that waits, not counted as dropped, and refuses whatever comes.
  void Close();

 private:
  // What counts towards the bounds, and all there is; of what was ever pushed or taken.
  struct Totals {
    std::uint64_t items = 0;
    std::uint64_t messages = 0;  // Of the data lane, without those past the bounds.
    std::uint64_t bytes = 0;     // Of these messages.
  };

  // What the reader has taken; written by it alone.
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

  // The data lane of a kLatestByKey mailbox: taken one by one, as what left is replaced no more.
  class KeyedItems {
   public:
    explicit KeyedItems(std::function<std::string(const proto::Message&)> key) : key_(std::move(key)) {}

    // Empty: the message replaces none. Any thread, without the lock.
    std::string KeyOf(const proto::Message& message) const;
    // Places are numbered as items come: the next one's, and the item at one that still waits.
    std::uint64_t next_place() const { return taken_ + items_.size(); }
    Item& at(std::uint64_t place) { return items_[place - taken_]; }
    Item& Add(Item&& item) { return items_.emplace_back(std::move(item)); }
    // The one that waits under `key`, or null.
    Item* Find(const std::string& key);
    // The newest item waits under `key`.
    void SetKeyOfNewest(const std::string& key);
    // False: nothing waits. `place`: where the item was.
    bool Take(Item& item, std::uint64_t& place);
    std::deque<Item> Clear();

   private:
    const std::function<std::string(const proto::Message&)> key_;
    std::deque<Item> items_;
    std::unordered_map<std::string, std::uint64_t> place_of_;  // By key.
    std::uint64_t taken_ = 0;
  };

  struct Limits {
    std::uint64_t messages;
    std::uint64_t bytes;
  };

  // With lock_ held.
  SendResult PushControl(Item& item);
  SendResult PushKeyed(Item& item, const std::string& key);
  SendResult PushStored(Item& item);
  SendResult PushData(Item& item);
  bool HasRoom(const Item& item);
  bool HasRoomInBytes(std::size_t bytes);
  bool FitsInBytes(std::size_t bytes, std::uint64_t bytes_max) const;
  void SeeTaken();
  void Count(const Item& item);
  Item* TakeControl();
  Item* TakeKeyed();

  const Limits limits_;
  const bool is_keyed_;  // kLatestByKey.

  mutable SpinLock lock_;
  bool is_reader_away_ = true;
  bool is_nudged_ = false;
  bool is_closed_ = false;
  std::vector<Item> pushed_items_;  // Empty if is_keyed_.
  Totals pushed_;
  Totals seen_;  // taken_ as last looked at: the reader's cache line is left alone while there is room.
  std::uint64_t waiting_max_ = 0;
  std::uint64_t bytes_max_ = 0;

  // The reader's; on a cache line of their own, as is what the senders write.
  alignas(64) std::vector<Item> items_;  // Taken over from pushed_items_; those before next_ were taken.
  std::size_t next_ = 0;
  Taken taken_;

  std::atomic<bool> has_control_ = false;

  // Seldom used. With lock_ held.
  std::optional<std::uint64_t> stored_place_;  // Where RecordsStored waits: in pushed_items_, or its place in keyed_.
  std::deque<Item> control_;
  KeyedItems keyed_;
  std::uint64_t dropped_ = 0;
  std::uint64_t replaced_ = 0;
  Item single_;  // The reader's: taken from one of these.
};

}  // namespace moondb
