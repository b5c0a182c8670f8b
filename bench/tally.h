// Tally: what one measurement waits for: every message of every sender, each once and in its sender's order.
//
// A message that was lost, doubled or overtaken makes the measurement fail, whoever was measured. Count is called on
// one thread at a time, the rest on any.
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
  // `per_sender` messages from each of so many senders.
  Tally(int sender_count, std::uint64_t per_sender);

  // What a message carries: whose it is and its number with that sender, from 0.
  static std::uint64_t IdOf(int sender, std::uint64_t number) { return std::uint64_t(sender) << kNumberBits | number; }

  void Count(std::uint64_t id) {
    const std::uint64_t sender = id >> kNumberBits;
    if (sender >= next_id_.size() || id != next_id_[sender]++)
      return Fail("message " + std::to_string(id) + " is not the next one");
    if (++counted_ == total_) Finish();
  }

  // For cases whose last message says that all is done.
  void Finish();
  void Fail(std::string reason);

  // kUnavailable: Fail, or not finished within two minutes.
  Result<void> Wait();

 private:
  static constexpr int kNumberBits = 48;

  const std::uint64_t total_;
  std::vector<std::uint64_t> next_id_;  // Of each sender.
  std::uint64_t counted_ = 0;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_finished_ = false;
  std::string failure_;
};

}  // namespace moondb
