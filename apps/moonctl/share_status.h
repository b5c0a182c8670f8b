// Shows one session in `sync status` and `replicate status`. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "proto/share_status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Rates since the destination last answered a Hello. Time out of reach before that does not count; silence since then
// does. Members are empty if the session is closed, has no answer yet, or has no acknowledged record yet.
struct SharePace {
  std::optional<double> bytes_per_s;  // Bytes after coding.
  std::optional<double> eta_s;        // Assumes the rate of the records so far. Maps are sent last and take longer.
};
SharePace PaceOf(const proto::ShareSession& session);

// The header and the rows of the status table. Unknown values are "-".
std::vector<std::string> ShareStatusHeader();
std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session);

}  // namespace moondb
