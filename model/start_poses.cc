#include "model/start_poses.h"

#include <algorithm>
#include <cmath>

namespace moondb {

namespace {

// Returns the rovers with a configured start, by ascending id.
std::vector<const proto::AgentConfig*> RoversWithStart(const proto::TeamConfig& team) {
  std::vector<const proto::AgentConfig*> rovers;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() != proto::AGENT_KIND_BASE_STATION && agent.has_start()) rovers.push_back(&agent);
  }
  std::sort(rovers.begin(), rovers.end(), [](const auto* a, const auto* b) { return a->id() < b->id(); });
  return rovers;
}

}  // namespace

std::vector<std::pair<AgentId, AgentId>> CoincidingStarts(const proto::TeamConfig& team) {
  const auto& footprint_m = team.map().footprint_m();
  const double near_m = footprint_m.empty() ? 0 : *std::max_element(footprint_m.begin(), footprint_m.end());
  std::vector<std::pair<AgentId, AgentId>> coinciding;
  std::vector<const proto::AgentConfig*> known;
  for (const proto::AgentConfig* rover : RoversWithStart(team)) {
    const auto other = std::find_if(known.begin(), known.end(), [&](const proto::AgentConfig* a) {
      return std::hypot(a->start().x() - rover->start().x(), a->start().y() - rover->start().y()) < near_m;
    });
    if (other == known.end()) {
      known.push_back(rover);
    } else {
      coinciding.emplace_back(rover->id(), (*other)->id());
    }
  }
  return coinciding;
}

Pose PoseOf(const proto::StartPose& start) {
  Pose pose = Pose::FromPlanar(start.x(), start.y(), start.yaw());
  pose.position_m.z() = start.z();
  return pose;
}

std::set<AgentId> KnownStarts(const proto::TeamConfig& team) {
  std::set<AgentId> known;
  for (const proto::AgentConfig* rover : RoversWithStart(team)) known.insert(rover->id());
  for (const auto& [rover, other] : CoincidingStarts(team)) known.erase(rover);
  return known;
}

}  // namespace moondb
