// Tally: waits until every message of every sender has arrived exactly once, in the order in which its sender sent
// them. A lost, duplicated or reordered message makes the measurement fail.
//
// Call Count on one thread at a time. All other functions are thread-safe.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

class Tally {
 public:
  // Expects `per_sender` messages from each of `sender_count` senders.
  Tally(int sender_count, std::uint64_t per_sender);

  // Returns the id of a message, made of its sender and of its number among the sender's messages, counted from 0.
  static std::uint64_t IdOf(int sender, std::uint64_t number) { return std::uint64_t(sender) << kNumberBits | number; }

  void Count(std::uint64_t id) {
    const std::uint64_t sender = id >> kNumberBits;
    if (sender >= next_id_.size() || id != next_id_[sender]++)
      return Fail("message " + std::to_string(id) + " is not the next one");
    if (++counted_ == total_) Finish();
  }

  // Ends Wait successfully. Needed by cases that do not count every message.
  void Finish();
  void Fail(std::string reason);

  // Waits until all messages have arrived or Finish is called. Fails with kUnavailable if Fail was called, or after two
  // minutes.
  Result<void> Wait();

 private:
  static constexpr int kNumberBits = 48;

  const std::uint64_t total_;
  std::vector<std::uint64_t> next_id_;  // Next expected id of each sender.
  std::uint64_t counted_ = 0;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_finished_ = false;
  std::string failure_;
};

}  // namespace moondb
