// Supervisor: decides when one failed actor is made anew, when its agent had better give up its role, and when the
// actor is beyond help.
//
// The first restart is immediate, for the failure that will not come again; each further one within `restart_period`
// waits twice as long as the one before it, for the cause that has to go away first (a full disk). More than
// `restarts_max` in that time: the agent gives up its role first, so that another leads, and the actor has as many
// restarts again, a long delay apart; then it is beyond help. So it is at once where it fails with kCorrupt: what it
// keeps on disk is damaged, which no restart mends. Not thread-safe.
#pragma once

#include <chrono>
#include <deque>

#include "runtime/actor.h"

namespace moondb {

class Supervisor {
 public:
  struct Options {
    int restarts_max = 5;  // Within restart_period.
    Duration restart_period = std::chrono::minutes(1);
    Duration first_delay = std::chrono::milliseconds(100);  // Before the second restart.
    Duration delay_max = std::chrono::seconds(10);
    double jitter_ratio = 0.2;   // Delays are this much shorter or longer, so that many do not come back at once.
    bool can_step_down = false;  // Whether there is a role to give up.
  };

  enum class Action {
    kRestart,
    kStepDown,   // Restart too.
    kBeyondHelp  // No restart.
  };
  struct Verdict {
    Action action = Action::kRestart;
    Duration delay{};  // Until the restart.
  };

  explicit Supervisor(Options options) : options_(options) {}

  // The actor failed at `now`. `jitter` is random, from 0 to 1.
  Verdict OnFailure(const Error& failure, MonotonicTime now, double jitter);

 private:
  Duration NextDelay() const;

  Options options_;
  std::deque<MonotonicTime> failures_;  // Those within restart_period, oldest first; at most restarts_max.
  bool has_stepped_down_ = false;
};

}  // namespace moondb
