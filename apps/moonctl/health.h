// What is wrong with a team, from what its agents say of themselves: for `moonctl health`. Pure function.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/control.pb.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr double kClockOffsetMax_s = 10;  // Between two agents; the message takes a part of it.
inline constexpr double kNoProgressMax_s = 60;   // Of an open session that waits for no window.

// Of one agent; what it did not answer is not judged.
struct AgentReport {
  std::optional<proto::AgentStatus> status;
  std::optional<proto::ShareStatus> shares;
};

// By agent id, a line for each thing that is wrong; none where all is well. `unreachable` agents have no status.
std::map<std::uint32_t, std::vector<std::string>> FindingsOn(const proto::TeamConfig& team,
                                                             const std::map<std::uint32_t, AgentReport>& reports);

}  // namespace moondb
