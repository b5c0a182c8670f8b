// Text of a request for the event log, for example "role set: leader rover2 (sun is low)". Empty for queries and dry
// runs, and for requests that robots' software repeats many times a minute (driving, sleeping). Plain functions.
// actors/gateway/command_table.h maps requests to them.
#pragma once

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

}  // namespace moondb
