// Leases: which agents of a team drive or sleep, and until when.
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
#include "proto/types.pb.h"

namespace moondb {

inline constexpr double kLeaseSecondsMax = 86400;

// 0 to kLeaseSecondsMax; kInvalid with `field` otherwise.
Result<void> CheckLeaseSeconds(double seconds, const std::string& field);

// "drives for 40 s more", "drives for 40 s and sleeps for 600 s more".
std::string ToString(const proto::AgentLease& lease);

class Leases {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;
  using List = google::protobuf::RepeatedPtrField<proto::AgentLease>;

  // `is_quiet_while_driving` is the team file's radio.quiet_while_driving.
  explicit Leases(bool is_quiet_while_driving) : is_quiet_while_driving_(is_quiet_while_driving) {}

  void Set(const proto::AgentLease& lease, Time now);  // Takes the place of that agent's. Checked before.
  void SetAll(const List& leases, Time now);           // Takes the place of everybody's.

  proto::AgentLease LeftOf(AgentId agent, Time now) const;  // Both 0 where it neither drives nor sleeps.
  List Left(Time now) const;                                // Of those that do, by agent.
  std::optional<Time> NextLapse(Time now) const;

  // Nothing bulky is to be sent by it or to it: it sleeps, or drives in a team that is quiet while driving.
  bool IsQuiet(AgentId agent, Time now) const;
  // The pair's window: neither is quiet.
  bool IsOpen(AgentId a, AgentId b, Time now) const { return !IsQuiet(a, now) && !IsQuiet(b, now); }

 private:
  struct Until {
    Time driving;
    Time sleeping;
  };

  bool is_quiet_while_driving_;
  std::map<AgentId, Until> until_;
};

}  // namespace moondb
