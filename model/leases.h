// Leases: tracks which agents of a team drive, sleep or are paused, and until when.
//
// A lease is a duration, not a time of day, because the clocks of the agents differ and jump. The duration counts from
// the time at which this agent learned of the lease, on this agent's monotonic clock. The caller passes the current
// time to each call. Value type.
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

// Fails with kInvalid and `field` unless `seconds` is 0 to kLeaseSecondsMax.
Result<void> CheckLeaseSeconds(double seconds, const std::string& field);

// Returns a text such as "drives for 40 s more" or "drives for 40 s and is paused for 600 s more". Empty if no lease is
// active.
std::string ToString(const proto::AgentLease& lease);

class Leases {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  // `is_quiet_while_driving` is the team file's radio.quiet_while_driving.
  explicit Leases(bool is_quiet_while_driving) : is_quiet_while_driving_(is_quiet_while_driving) {}

  // Replaces the agent's leases. Requires: CheckLeaseSeconds accepts the durations.
  void Set(const proto::AgentLease& lease, Time now);
  void SetAll(const proto::LeasesChanged& changed);  // Replaces the leases of all agents.

  // Returns the remaining seconds of each kind of lease; 0 if the lease is not active.
  proto::AgentLease LeftOf(AgentId agent, Time now) const;
  proto::LeasesChanged Left(Time now) const;       // Returns the remaining times of all agents with an active lease.
  std::optional<Time> NextExpiry(Time now) const;  // Returns when the next lease expires; nullopt if none is active.

  // Returns whether the agent sleeps, or drives in a team with radio silence while driving. Other agents must not treat
  // such an agent as lost.
  bool MayBeSilent(AgentId agent, Time now) const;
  // Returns whether bulk transfers from and to the agent must stop, because the agent may be silent or its sharing is
  // paused.
  bool IsQuiet(AgentId agent, Time now) const;
  // Returns whether bulk transfers between the two agents are allowed: IsQuiet is false for both.
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
