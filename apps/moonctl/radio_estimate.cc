#include "apps/moonctl/radio_estimate.h"

#include <algorithm>

#include "apps/common/table.h"
#include "model/data_types.h"
#include "model/text.h"
#include "proto/types.pb.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

// Coded bytes of a record, as measured with intel_team (docs/SIZING.md), and records of a robot in an hour.
constexpr double kMapBytes = 254;
constexpr double kNodeBytes = 54;
constexpr double kPoseBytes = 43;
constexpr double kNodesAnHour = 362;
constexpr double kSolvesAnHour = 12;
constexpr double kBytesOnAir = 1.25;    // Bytes sent for each coded byte.
constexpr double kUsedOfBudget = 0.85;  // Part of the budget that records fill.

}  // namespace

double TeamMapPart(const proto::TeamConfig& team) {
  const auto rovers = static_cast<double>(std::ranges::count_if(team.agents(), [](const proto::AgentConfig& agent) {
    return agent.kind() == proto::AGENT_KIND_ROVER && !agent.left();
  }));
  const auto has = [&team](DataType type) { return RoversPolicyOf(team, type) != proto::POLICY_NONE ? 1.0 : 0.0; };
  const double others = std::max(rovers - 1, 0.0);
  // The leader brings each other rover the records of all but itself, and the poses of all.
  const double new_bytes =
      others * others * kNodesAnHour *
      (has(proto::LOCAL_TRAVERSABILITY_MAP) * kMapBytes + has(proto::POSE_GRAPH_NODE) * kNodeBytes);
  const double pose_bytes = others * rovers * kNodesAnHour * has(proto::OPTIMIZED_POSE) * kPoseBytes;
  const double bytes_a_second = (new_bytes + kSolvesAnHour * pose_bytes) * kBytesOnAir / 3600;
  return bytes_a_second * 8 / (team.radio().budget_kbps() * 1000 * kUsedOfBudget);
}

std::string TeamMapText(const proto::TeamConfig& team) {
  const double part = TeamMapPart(team);
  if (part == 0) return "";
  const std::string text = "sending the team's map to every rover takes about " + FormatSeconds(part * 3600) +
                           " of the leader's radio time per hour (" + FormatFixed(part * 100, 1) + " % of " +
                           FormatDouble(team.radio().budget_kbps()) +
                           " kbit/s), with a node and a map every 10 s and 12 solves per hour";
  if (part <= kTeamMapPartMax) return "note: " + text;
  return "warning: " + text + "; this is more than " + FormatFixed(kTeamMapPartMax * 100, 0) +
         " %: use a faster radio, or send rovers no maps (docs/MAPS.md)";
}

}  // namespace moondb
