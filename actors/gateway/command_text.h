// Texts of requests for the event log, for example "role set: leader rover2 (sun is low)". A text is empty if the
// request is not logged. Queries, dry runs, and the robot's frequent reports of driving and sleeping are not logged.
// actors/gateway/command_table.h maps requests to these functions.
#pragma once

#include <set>
#include <string>

#include "proto/control.pb.h"
#include "proto/team.pb.h"

namespace moondb {

std::string RoleText(const proto::TeamConfig& team, const proto::RoleSetRequest& set);
std::string ShareText(const proto::TeamConfig& team, const proto::ShareRequest& share);
std::string OptimizeText(const proto::OptimizeRequest& optimize);
std::string DownlinkText(const proto::DownlinkRequest& downlink);
std::string LeaseText(const proto::LeaseRequest& lease);
std::string PruneText(const proto::PruneOrder& prune);

// Returns "a", or "a and b".
std::string NamesText(const std::set<std::string>& names);

}  // namespace moondb
