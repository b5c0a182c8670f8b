// Timeline: for each agent, how many records it has made, and how many of them the leader, the designated survivor and
// the ground station hold, over time. The gap between the curves is what a loss would cost. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Numbers of records of one agent. Absent: not known.
struct TimelineCounts {
  std::optional<double> created;
  std::optional<double> leader;
  std::optional<double> survivor;
  std::optional<double> ground;
};

class Timeline {
 public:
  static constexpr std::size_t kSamplesMax = 600;  // Then every second sample is dropped, and the period doubles.

  // A sample within the period after the last one replaces that one.
  void Add(double time_s, const std::map<AgentId, TimelineCounts>& counts);
  std::string Json(const proto::TeamConfig& team) const;

 private:
  struct Sample {
    double time_s = 0;
    std::map<AgentId, TimelineCounts> counts;
  };
  double period_s_ = 2;
  std::vector<Sample> samples_;
};

struct TeamReports;
// Returns the counts of each agent, by the have-sets that the reports hold.
std::map<AgentId, TimelineCounts> TimelineCountsOf(const proto::TeamConfig& team, const TeamReports& reports);

}  // namespace moondb
