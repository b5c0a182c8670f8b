// Derives a team's faults from its agents' reports, for `moonctl health`. Pure functions.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/graph.pb.h"
#include "proto/share_status.pb.h"
#include "proto/status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr double kClockOffsetMax_s = 10;  // Between two agents. The travel time of the message is part of it.
inline constexpr double kNoProgressMax_s = 60;   // For an open session that waits for no window.

// The report of one agent. Missing members are not judged.
struct AgentReport {
  std::optional<proto::AgentStatus> status;
  std::optional<proto::ShareStatus> shares;
  std::optional<proto::OptimizeReply> last_solve;  // Only of the leader.
  std::uint64_t config_hash = 0;                   // TeamFile::hash of its team file. 0: not reported.
};

// Returns one line per fault, by agent id. An agent without faults has none. Agents that cannot be reached have no
// status. A finding of an agent (AgentStatus.findings) is a fault until an operator acknowledges it. `config_hash` is
// the hash of the file from which `team` was read; 0 disables the comparison with the agents' hashes.
std::map<std::uint32_t, std::vector<std::string>> FindingsOn(const proto::TeamConfig& team,
                                                             const std::map<std::uint32_t, AgentReport>& reports,
                                                             std::uint64_t config_hash = 0);

// Returns "hash 9f3a..., here 4c01..." for an agent whose team file differs from the one read here.
std::string OtherConfigText(std::uint64_t theirs, std::uint64_t here);

// Returns the term and its issuer: "4 by rover2".
std::string IssuedTermText(const proto::TeamConfig& team, const proto::Term& term);

// Returns a warning that an agent knows a newer assignment but cannot write it to its disk.
std::string UnstoredText(const proto::TeamConfig& team, const proto::RoleAssignment& unstored);

}  // namespace moondb
