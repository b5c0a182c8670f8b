// Supervisor: decides, after an actor failed, whether and when to restart it, and whether its agent should give up its
// role.
//
// The first restart is immediate, and the second follows after `first_delay`. Each further restart within
// `restart_period` waits twice as long as the one before, up to `delay_max`. If the actor fails again after
// `restarts_max` restarts in that period, the agent gives up its role, so that another agent can lead. The actor then
// gets `restarts_max` further restarts, with long delays. If the actor still fails, or if `can_step_down` is false, the
// failure is permanent (kBeyondHelp). A failure with kCorrupt is permanent at once, because a restart does not repair
// damaged data on disk. Not thread-safe.
#pragma once

#include <chrono>
#include <deque>

#include "runtime/actor.h"

namespace moondb {

class Supervisor {
 public:
  struct Options {
    int restarts_max = 5;  // Limit of restarts within restart_period.
    Duration restart_period = std::chrono::minutes(1);
    Duration first_delay = std::chrono::milliseconds(100);  // Delay before the second restart.
    Duration delay_max = std::chrono::seconds(10);
    double jitter_ratio = 0.2;   // Delays vary by this ratio up or down, so that actors do not restart simultaneously.
    bool can_step_down = false;  // True if the agent may have a role to give up.
  };

  enum class Action {
    kRestart,
    kStepDown,   // The agent gives up its role, and the actor restarts.
    kBeyondHelp  // The failure is permanent: the actor does not restart.
  };
  struct Verdict {
    Action action = Action::kRestart;
    Duration delay{};  // Delay before the restart.
  };

  explicit Supervisor(Options options) : options_(options) {}

  // Returns how to react to a failure at `now`. `jitter` is a random number from 0 to 1.
  Verdict OnFailure(const Error& failure, MonotonicTime now, double jitter);

 private:
  Duration NextDelay() const;

  Options options_;
  std::deque<MonotonicTime> failures_;  // Failures within restart_period, oldest first; at most restarts_max.
  bool has_stepped_down_ = false;
};

}  // namespace moondb
