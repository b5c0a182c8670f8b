// Shows one session in `sync status` and `replicate status`. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "proto/share_status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// The pace of a session since its destination last answered a Hello. Time before that answer does not count; silence
// after it does. Members are empty if the session is closed, or if it has no answer or no acknowledged record yet.
struct SharePace {
  std::optional<double> bytes_per_s;  // Bytes after coding.
  std::optional<double> eta_s;        // Time left at the rate of the records so far. Maps come last and take longer.
};
SharePace PaceOf(const proto::ShareSession& session);

// The header and the rows of the status table. Unknown values are "-".
std::vector<std::string> ShareStatusHeader();
std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session);

}  // namespace moondb
