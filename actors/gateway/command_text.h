// A request in words, for the event log: "role set: leader rover2 (sun is low)". Empty for what is only asked or tried,
// and for what robots' software repeats many times a minute: that a robot drives or sleeps. Plain functions;
// actors/gateway/command_table.h says which one is whose.
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
