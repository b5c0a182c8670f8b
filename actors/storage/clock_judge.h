// ClockJudge: whether this agent's UTC clock can be trusted, judged by what other agents' clocks say, by its own jumps
// and by what cannot be.
//
// A robot's computer begins in 1970 after a cold start, or hours ahead of its team. Stamps decide which of two maps is
// newer, so what is inserted meanwhile is marked (Record.is_clock_suspect) and wins nothing by its stamp. The clock is
// suspect
//   - before 2024: it was never set;
//   - when it is more than a minute off more agents' clocks than it agrees with, itself counted; as many on both
//     sides: when it is off the base station's;
//   - after a jump of more than a minute, until another agent's clock agrees with it.
// Between the moments when others report, their clocks count on with this agent's monotonic one. A clock that is wrong
// before any other agent was heard of, and plausible, is not noticed.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/ids.h"

namespace moondb {

class ClockJudge {
 public:
  // On this agent's monotonic clock.
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  // `base_station` 0: the team has none.
  explicit ClockJudge(AgentId base_station) : base_station_(base_station) {}

  // A peer said just now that it is `utc_ns` (since 1970). What cannot be is taken as no report.
  void NotePeer(AgentId peer, std::int64_t utc_ns, Time now);

  // How much later the peers' clocks are than this agent's, which says `utc_ns`, as each said last.
  struct PeerOffset {
    AgentId peer = 0;
    double offset_s = 0;
    double age_s = 0;  // Of that word.
  };
  std::vector<PeerOffset> PeerOffsets(std::int64_t utc_ns, Time now) const;

  struct Verdict {
    std::string suspect;      // Why, for people; empty: it is not.
    bool has_jumped = false;  // Since it was last asked.
  };
  // Of this agent's clock, which says `utc_ns`.
  Verdict Judge(std::int64_t utc_ns, Time now);

 private:
  const AgentId base_station_;
  struct Peer {
    std::int64_t offset_ns = 0;  // Of its UTC to this agent's monotonic clock.
    Time heard;
  };
  std::map<AgentId, Peer> peers_;
  std::optional<std::int64_t> offset_ns_;  // Of its own, when it was last asked.
  double unproven_jump_s_ = 0;             // 0: none.
  bool was_never_set_ = false;             // When it was last asked.
};

}  // namespace moondb
