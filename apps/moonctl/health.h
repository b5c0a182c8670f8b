// Finds the faults of a team in its agents' reports, for `moonctl health`. Thread-safe.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/graph.pb.h"
#include "proto/map.pb.h"
#include "proto/registration.pb.h"
#include "proto/share_status.pb.h"
#include "proto/status.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// A larger difference between the clocks of two agents is a fault. The difference includes the travel time of a
// message.
inline constexpr double kClockOffsetMax_s = 10;
// An open session with no reason to wait is a fault if it makes no progress for longer than this time.
inline constexpr double kNoProgressMax_s = 60;

// The answers of one agent. FindingsOn ignores missing members.
struct AgentReport {
  std::optional<proto::AgentStatus> status;
  std::optional<proto::ShareStatus> shares;
  std::optional<proto::OptimizeReply> last_solve;        // Set only for the leader.
  std::optional<proto::MapStatsReply> map_stats;         // Set only for the leader.
  std::optional<proto::RegistrationReply> registration;  // Set only for the leader.
  std::uint64_t config_hash = 0;                         // TeamFile::hash of the agent's team file. 0: not reported.
};

// Returns the faults of each agent, one line per fault, by agent id. Agents without faults have no entry. A finding of
// an agent (AgentStatus.findings) is a fault until an operator acknowledges the finding. `config_hash` is the hash of
// the file from which `team` was read; 0 disables the comparison with the agents' hashes.
std::map<std::uint32_t, std::vector<std::string>> FindingsOn(const proto::TeamConfig& team,
                                                             const std::map<std::uint32_t, AgentReport>& reports,
                                                             std::uint64_t config_hash = 0);

// Returns text such as "hash 9f3a..., here 4c01..." for an agent whose team file differs from the team file read here.
std::string OtherConfigText(std::uint64_t theirs, std::uint64_t here);

// Returns the term and the agent that issued it: "4 by rover2".
std::string IssuedTermText(const proto::TeamConfig& team, const proto::Term& term);

// Returns a warning that an agent cannot write the newer assignment `unstored` to its disk.
std::string UnstoredText(const proto::TeamConfig& team, const proto::RoleAssignment& unstored);

}  // namespace moondb
