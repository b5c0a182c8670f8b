// Supervisor: decides when one failed actor is made anew, and when it is beyond help.
//
// The first restart is immediate, for the failure that will not come again; each further one within `restart_period`
// waits twice as long as the one before it, for the cause that has to go away first (a full disk). Not thread-safe.
#pragma once

#include <chrono>
#include <deque>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

class Supervisor {
 public:
  struct Options {
    int restarts_max = 5;  // Within restart_period.
    Duration restart_period = std::chrono::minutes(1);
    Duration first_delay = std::chrono::milliseconds(100);  // Before the second restart.
    Duration delay_max = std::chrono::seconds(10);
  };

  explicit Supervisor(Options options) : options_(options) {}

  // The actor failed at `now`. How long to wait before it is made anew; nothing if restarts_max is reached.
  std::optional<Duration> OnFailure(MonotonicTime now);

 private:
  Options options_;
  std::deque<MonotonicTime> failures_;  // Those within restart_period, oldest first; at most restarts_max.
};

}  // namespace moondb
