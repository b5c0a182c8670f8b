// What `sync status` and `replicate status` say of one session. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "proto/share_status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// From what was acknowledged since the destination last answered a Hello: hours out of reach do not count, silence
// since then does. Nothing where that says nothing: closed, not answered yet, nothing acknowledged yet.
struct SharePace {
  std::optional<double> bytes_per_s;  // Coded.
  std::optional<double> eta_s;        // At the records' pace so far; maps go last and take longer.
};
SharePace PaceOf(const proto::ShareSession& session);

// A table's header, and a row of it: "-" where nothing is known.
std::vector<std::string> ShareStatusHeader();
std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session);

}  // namespace moondb
