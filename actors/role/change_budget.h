// ChangeBudget: a token bucket per issuer that limits how often an agent adopts role assignments of another agent.
// Without a limit, one member that may decide roles could keep the whole team busy with changes. Allows a burst of
// kAtOnce assignments, then kPerHour per hour.
#pragma once

#include <algorithm>
#include <chrono>
#include <map>

#include "model/ids.h"

namespace moondb {

class ChangeBudget {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  static constexpr double kAtOnce = 20;
  static constexpr double kPerHour = 60;

  // Takes one token of the issuer. Returns false if none is left.
  bool Takes(AgentId issuer, Time now) {
    Issuer& known = issuers_.try_emplace(issuer, Issuer{kAtOnce, now}).first->second;
    const double hours = std::chrono::duration<double, std::ratio<3600>>(now - known.at).count();
    known.left = std::min(kAtOnce, known.left + hours * kPerHour);
    known.at = now;
    if (known.left < 1) return false;
    known.left -= 1;
    return true;
  }

 private:
  struct Issuer {
    double left = kAtOnce;  // Tokens left at time `at`.
    Time at{};
  };

  std::map<AgentId, Issuer> issuers_;
};

}  // namespace moondb
