// TimerQueue: values ordered by their due time, and by insertion order for equal times.
//
// Not thread-safe. Add, Cancel and TakeDue cost O(log n).
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>

#include "model/check.h"
#include "runtime/actor.h"

namespace moondb {

template <typename T>
class TimerQueue {
 public:
  static constexpr std::size_t kSizeMax = 1'000'000;  // A larger queue is a bug in an actor and fails a Check.

  // Adds a value. Returns an id for Cancel. Ids count from 1 and are never reused.
  TimerId Add(MonotonicTime due, T value) {
    Check(by_due_.size() < kSizeMax, "fewer than a million timers wait");
    const TimerId id = ++last_id_;
    by_due_.emplace(Key(due, id), std::move(value));
    due_of_.emplace(id, due);
    return id;
  }

  // Removes a timer. Has no effect if TakeDue already returned the timer's value.
  void Cancel(TimerId id) {
    const auto found = due_of_.find(id);
    if (found == due_of_.end()) return;
    by_due_.erase(Key(found->second, id));
    due_of_.erase(found);
  }

  std::optional<MonotonicTime> NextDue() const {
    if (by_due_.empty()) return std::nullopt;
    return by_due_.begin()->first.first;
  }

  // Removes and returns the first value that is due at `now`, with its due time. Returns nothing if none is due.
  std::optional<std::pair<MonotonicTime, T>> TakeDue(MonotonicTime now) {
    const auto first = by_due_.begin();
    if (first == by_due_.end() || first->first.first > now) return std::nullopt;
    auto due = std::make_pair(first->first.first, std::move(first->second));
    due_of_.erase(first->first.second);
    by_due_.erase(first);
    return due;
  }

  std::size_t size() const { return by_due_.size(); }

 private:
  using Key = std::pair<MonotonicTime, TimerId>;

  std::map<Key, T> by_due_;
  std::unordered_map<TimerId, MonotonicTime> due_of_;
  TimerId last_id_ = 0;
};

}  // namespace moondb
