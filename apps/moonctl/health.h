// What is wrong with a team, from what its agents say of themselves: for `moonctl health`. Pure function.
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

inline constexpr double kClockOffsetMax_s = 10;  // Between two agents; the message takes a part of it.
inline constexpr double kNoProgressMax_s = 60;   // Of an open session that waits for no window.

// Of one agent; what it did not answer is not judged.
struct AgentReport {
  std::optional<proto::AgentStatus> status;
  std::optional<proto::ShareStatus> shares;
  std::optional<proto::OptimizeReply> last_solve;  // The leader's.
  std::uint64_t config_hash = 0;                   // Of its team file; 0: it did not say.
};

// By agent id, a line for each thing that is wrong; none where all is well. `unreachable` agents have no status. What
// an agent found that no operator has acknowledged (AgentStatus.findings) is wrong until one does.
// `config_hash`: of the team file that `team` was read from; 0: agents' own are not compared with it.
std::map<std::uint32_t, std::vector<std::string>> FindingsOn(const proto::TeamConfig& team,
                                                             const std::map<std::uint32_t, AgentReport>& reports,
                                                             std::uint64_t config_hash = 0);

// "hash 9f3a..., here 4c01...": of an agent whose team file is another one than the one that was read here.
std::string OtherConfigText(std::uint64_t theirs, std::uint64_t here);

// "4 by rover2".
std::string IssuedTermText(const proto::TeamConfig& team, const proto::Term& term);

// Warns that an agent knows of a newer assignment and its disk does not take it.
std::string UnstoredText(const proto::TeamConfig& team, const proto::RoleAssignment& unstored);

}  // namespace moondb
