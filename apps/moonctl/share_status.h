// Formats one session for `sync status` and `replicate status`. Thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "proto/share_status.pb.h"
#include "proto/status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// The average rate of a session since its destination last answered a Hello, including pauses. Members are empty if the
// session is closed, or if it has no answer or no acknowledged record yet.
struct SharePace {
  std::optional<double> bytes_per_s;  // Acknowledged bytes (after coding) per second.
  // Estimated time in seconds until all records are acknowledged, from the average number of acknowledged records per
  // second. Too short while maps remain, because maps are sent last and take longer.
  std::optional<double> eta_s;
};
SharePace PaceOf(const proto::ShareSession& session);

// Returns the number of records that the agent has left for the session's destination; null if it is not known. Counts
// the records in the agent's store that the destination has not acknowledged, also if no session is open. For a
// leader's records to a rover, only an open session knows.
std::optional<double> LeftOf(const proto::AgentStatus* status, const proto::ShareSession& session);

// The header and the rows of the status table. Unknown values are "-".
std::vector<std::string> ShareStatusHeader();
std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session, std::optional<double> left);

}  // namespace moondb
