// HandshakeLimit: limits how many connections one key may open per minute, including connections that have closed.
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <iterator>
#include <map>
#include <string>

#include "runtime/actor.h"

namespace moondb {

class HandshakeLimit {
 public:
  static constexpr std::size_t kPerMinute = 60;

  // Returns true if fewer than kPerMinute handshakes with this key were counted in the last minute.
  bool HasRoom(const std::string& key, MonotonicTime now) {
    Forget(now);
    const auto times = recent_.find(key);
    return times == recent_.end() || times->second.size() < kPerMinute;
  }
  // Counts an admitted handshake.
  void Count(const std::string& key, MonotonicTime now) { recent_[key].push_back(now); }

 private:
  void Forget(MonotonicTime now) {
    for (auto times = recent_.begin(); times != recent_.end();) {
      std::deque<MonotonicTime>& of_key = times->second;
      while (!of_key.empty() && of_key.front() <= now - std::chrono::minutes(1)) of_key.pop_front();
      times = of_key.empty() ? recent_.erase(times) : std::next(times);
    }
  }

  std::map<std::string, std::deque<MonotonicTime>> recent_;  // Times of handshakes by key, oldest first.
};

}  // namespace moondb
