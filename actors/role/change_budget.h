// ChangeBudget: how often an agent acts on what one other issuer decides. Each assignment is stored, applied and
// announced on: without a limit a member that may decide could keep the whole team from its work.
//
// kAtOnce, then kPerHour; what waits is announced again, and only the newest of it. A plain value.
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

  // Whether one more of this issuer's may be acted on by now; if so it is.
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
    double left = kAtOnce;  // As of `at`.
    Time at{};
  };

  std::map<AgentId, Issuer> issuers_;
};

}  // namespace moondb
