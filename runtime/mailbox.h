// Mailbox: the messages that wait for one actor, in the order in which they came; bounded in number and bytes.
//
// Not thread-safe: its owner guards it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

class Mailbox {
 public:
  struct Item {
    MessagePtr message;
    std::size_t bytes = 0;          // Towards the bound.
    bool is_system = false;         // Past the bounds.
    std::uint64_t incarnation = 0;  // Of the actor whose timer this is; 0: for any incarnation.
  };

  explicit Mailbox(const SpawnOptions& options);

  // `bytes` is the message's serialised size. False if a bound would be passed: dropped and counted. A message larger
  // than bytes_max is taken when no other counts towards the bytes.
  [[nodiscard]] bool Push(MessagePtr message, std::size_t bytes);

  // Past the bounds, for what the runtime itself says and the sender could not repeat: an actor's own timers
  // (bounded by TimerQueue) and peers that come and go.
  void PushSystem(MessagePtr message, std::uint64_t incarnation = 0);

  std::optional<Item> Pop();
  void Clear();  // Not counted as dropped.

  bool empty() const { return items_.empty(); }
  std::size_t size() const { return items_.size(); }
  std::size_t bytes() const { return bytes_; }
  std::size_t size_max() const { return size_max_; }  // The most that ever waited.
  std::uint64_t dropped() const { return dropped_; }

 private:
  void Append(Item item);

  std::size_t messages_limit_;
  std::size_t bytes_limit_;
  std::deque<Item> items_;
  std::size_t system_count_ = 0;  // Of items_, those past the bounds.
  std::size_t bytes_ = 0;
  std::size_t size_max_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace moondb
