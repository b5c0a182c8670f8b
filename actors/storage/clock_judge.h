// ClockJudge decides whether this agent's UTC clock can be trusted. It compares the clock with the clocks of other
// agents, and detects jumps and implausible values.
//
// Records that are inserted while the clock is suspect are marked (Record.is_clock_suspect). The timestamp of a marked
// record never counts as newer than another timestamp. The clock is suspect
//   - before 2024, because it was never set;
//   - if more clocks of the team differ from it by over a minute than agree with it (this agent's clock counts as
//     agreeing); in a tie, if it differs from the base station's clock;
//   - after a jump of more than a minute, until another agent's clock agrees with it.
// A record's own timestamp is suspect before 2020, or more than a day ahead of this agent's trusted clock: the robot's
// software has no right clock then, or counts from 0 (IsSuspectTimestamp).
// Between two reports of a peer, the peer's clock is extrapolated with this agent's monotonic clock. A plausible but
// wrong clock is not detected before the first report of a peer.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/ids.h"

namespace moondb {

inline constexpr std::int64_t kTimestampMin_ns = 1'577'836'800'000'000'000;  // 2020-01-01.
inline constexpr std::chrono::hours kTimestampAheadMax{24};

// Returns whether a record's timestamp lies outside these limits. Requires: this agent's clock, which shows `utc_ns`,
// is trusted.
bool IsSuspectTimestamp(std::int64_t timestamp_ns, std::int64_t utc_ns);

class ClockJudge {
 public:
  // A time on this agent's monotonic clock.
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  // `base_station` is 0 if the team has no base station.
  explicit ClockJudge(AgentId base_station) : base_station_(base_station) {}

  // Remembers that the clock of `peer` shows `utc_ns` (since 1970) now. An implausible value removes the peer's last
  // report.
  void ObservePeer(AgentId peer, std::int64_t utc_ns, Time now);

  // PeerOffsets returns the offset of each peer's clock from this agent's clock, which shows `utc_ns`. An offset is
  // positive if the peer's clock is ahead.
  struct PeerOffset {
    AgentId peer = 0;
    double offset_s = 0;
    double age_s = 0;  // Age of the peer's last report.
  };
  std::vector<PeerOffset> PeerOffsets(std::int64_t utc_ns, Time now) const;

  struct Verdict {
    std::string suspect;      // Why the clock is suspect, as text for people; empty if trusted.
    bool has_jumped = false;  // True if the clock jumped since the last call of Judge.
  };
  // Judges this agent's clock, which shows `utc_ns`.
  Verdict Judge(std::int64_t utc_ns, Time now);

 private:
  const AgentId base_station_;
  struct Peer {
    std::int64_t offset_ns = 0;  // The peer's UTC minus this agent's monotonic clock.
    Time heard;
  };
  std::map<AgentId, Peer> peers_;
  // This agent's UTC minus its monotonic clock at the last call of Judge; null if its UTC was implausible.
  std::optional<std::int64_t> offset_ns_;
  // Sum of the jumps of this agent's clock since another agent's clock last agreed with it.
  double unproven_jump_s_ = 0;
  // True if the UTC clock was implausible at the last call of Judge.
  bool was_never_set_ = false;
};

}  // namespace moondb
