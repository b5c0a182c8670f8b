// Leases: which agents of a team drive, sleep or are paused, and until when.
//
// A lease is a duration that counts down on this agent's own monotonic clock from when it became known here, never a
// time of day: the agents' clocks differ and jump. It lapses by itself. Time comes in with each call. Plain value.
#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/lease.pb.h"

namespace moondb {

inline constexpr double kLeaseSecondsMax = 86400;

// 0 to kLeaseSecondsMax; kInvalid with `field` otherwise.
Result<void> CheckLeaseSeconds(double seconds, const std::string& field);

// "drives for 40 s more", "drives for 40 s and is paused for 600 s more"; empty for none of it.
std::string ToString(const proto::AgentLease& lease);

class Leases {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  // `is_quiet_while_driving` is the team file's radio.quiet_while_driving.
  explicit Leases(bool is_quiet_while_driving) : is_quiet_while_driving_(is_quiet_while_driving) {}

  void Set(const proto::AgentLease& lease, Time now);  // Takes the place of that agent's. Checked before.
  void SetAll(const proto::LeasesChanged& changed);    // Takes the place of everybody's.

  proto::AgentLease LeftOf(AgentId agent, Time now) const;  // 0 for what it does not do.
  proto::LeasesChanged Left(Time now) const;                // By agent, without agents that do none of it.
  std::optional<Time> NextExpiry(Time now) const;

  // It sleeps, or drives in a team that is quiet while driving: who hears nothing of it need not take it for lost.
  bool MayBeSilent(AgentId agent, Time now) const;
  // Nothing bulky is to be sent by it or to it: it may be silent, or its sharing is paused.
  bool IsQuiet(AgentId agent, Time now) const;
  // The pair's window: neither is quiet.
  bool IsOpen(AgentId a, AgentId b, Time now) const { return !IsQuiet(a, now) && !IsQuiet(b, now); }

 private:
  struct Until {
    Time driving;
    Time sleeping;
    Time paused;
  };

  bool is_quiet_while_driving_;
  std::map<AgentId, Until> until_;
};

}  // namespace moondb
