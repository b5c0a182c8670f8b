#include "actors/gateway/command_text.h"

#include <cmath>
#include <cstdio>

#include "model/agent_name.h"
#include "model/leases.h"
#include "model/record_key.h"

namespace moondb {

std::string RoleText(const proto::TeamConfig& team, const proto::RoleSetRequest& set) {
  if (set.is_dry_run()) return "";
  std::string text = set.is_swap() ? "role swap" : "role set:";
  if (set.leader() != 0) text += " leader " + AgentName(team, set.leader());
  if (set.survivor() != 0) text += " survivor " + AgentName(team, set.survivor());
  return set.reason().empty() ? text : text + " (" + set.reason() + ")";
}

std::string ShareText(const proto::TeamConfig& team, const proto::ShareRequest& share) {
  std::string text = share.kind() == proto::SHARING_KIND_SYNC ? "sync now" : "replicate now";
  if (share.destination() != 0) text += " to " + AgentName(team, share.destination());
  return text;
}

std::string OptimizeText(const proto::OptimizeRequest& optimize) {
  std::string text = "graph optimize";
  if (optimize.from_scratch()) text += " from scratch";
  if (optimize.window_nodes() > 0) text += ", window of " + std::to_string(optimize.window_nodes());
  return text;
}

std::string DownlinkText(const proto::DownlinkRequest& downlink) {
  if (downlink.acknowledge() != 0) return "downlink ack " + std::to_string(downlink.acknowledge());
  return downlink.bytes_max() == 0 ? "" : "downlink of " + std::to_string(downlink.bytes_max()) + " B";
}

// Returns the text for a valid pause or resume, and an empty text for all other leases. Driving and sleeping are not
// logged: the robot's software reports them many times a minute.
std::string LeaseText(const proto::LeaseRequest& lease) {
  if (lease.kind() != proto::LEASE_KIND_PAUSED || !CheckLeaseSeconds(lease.seconds(), "")) return "";
  if (lease.seconds() == 0) return "sync resume";
  return "sync pause for " + std::to_string(static_cast<int>(std::ceil(lease.seconds()))) + " s";
}

// Prints numbers in the request's units: seconds and bytes.
std::string PruneText(const proto::PruneOrder& prune) {
  if (prune.is_dry_run()) return "";
  std::string text = prune.is_history()      ? "db prune history"
                     : prune.occluded_maps() ? "db prune occluded maps"
                                             : "db prune";
  for (const DataType type : prune.data_types()) text += " " + DataTypeName(type);
  char limit[64];
  if (prune.older_than_s() > 0) {
    std::snprintf(limit, sizeof limit, " older than %.0f s", prune.older_than_s());
    text += limit;
  }
  if (prune.content_bytes_max() > 0) {
    std::snprintf(limit, sizeof limit, ", at most %.0f bytes", prune.content_bytes_max());
    text += limit;
  }
  return text;
}

std::string NamesText(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " and ") + name;
  return text;
}

}  // namespace moondb
