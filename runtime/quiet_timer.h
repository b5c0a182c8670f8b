// QuietTimer: notifies an actor when no news has arrived for a while, so that it does its work once for many records.
//
// Call the timer only in the handlers of one actor. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

class QuietTimer {
 public:
  struct Options {
    std::uint32_t kind = 0;               // Kind of the actor's timer.
    Duration quiet{};                     // Work is due once no news has arrived for this long.
    Duration wait_max = Duration::max();  // Work is due at the latest this long after the oldest news.
    Duration apart{};                     // Shortest time from one due work to the next.
  };

  explicit QuietTimer(const Options& options) : options_(options) {}

  // Call when news has arrived.
  void OnNews(Context& context);
  // Call when the actor's timer of this kind fires. Returns true if the work is due. Otherwise the timer runs on while
  // there is news, also if the actor is busy.
  bool OnTimer(Context& context, bool is_busy);
  // Call when the work for all news was done otherwise, or has become pointless.
  void Stop() { has_news_ = false; }
  bool has_news() const { return has_news_; }  // News has arrived, and the work is not due yet.

 private:
  const Options options_;
  bool has_news_ = false;
  bool is_armed_ = false;  // A timer of the actor is pending.
  MonotonicTime oldest_news_{};
  MonotonicTime newest_news_{};
  std::optional<MonotonicTime> last_due_;
};

}  // namespace moondb
