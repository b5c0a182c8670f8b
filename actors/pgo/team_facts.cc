#include "actors/pgo/team_facts.h"

#include <set>

#include "model/start_poses.h"

namespace moondb {

namespace {

std::optional<Eigen::Vector3d> ToVector(const google::protobuf::RepeatedField<double>& numbers) {
  if (numbers.size() != 3) return std::nullopt;
  return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

AgentFacts FactsOf(const proto::AgentConfig& agent, bool is_start_known) {
  AgentFacts facts;
  facts.agent = agent.id();
  facts.is_base_station = agent.kind() == proto::AGENT_KIND_BASE_STATION;
  facts.antenna_m = ToVector(agent.antenna_m()).value_or(Eigen::Vector3d::Zero());
  facts.has_fixed_scale = agent.pose_graph().odometry_scale() == proto::ODOMETRY_SCALE_FIXED;
  if (facts.is_base_station) {
    const std::optional<Eigen::Vector3d> position_m = ToVector(agent.position_m());
    if (position_m) facts.start = Pose{*position_m, Eigen::Quaterniond::Identity()};
  } else if (is_start_known) {
    const proto::StartPose& start = agent.start();
    facts.start = PoseOf(start);
    facts.start_sigma_m = start.sigma_m();
    facts.start_sigma_rad = start.sigma_rad();
  }
  return facts;
}

}  // namespace

AgentFactsMap FactsOf(const proto::TeamConfig& team) {
  AgentFactsMap facts;
  const std::set<AgentId> known_starts = KnownStarts(team);
  for (const proto::AgentConfig& agent : team.agents()) {
    facts[agent.id()] = FactsOf(agent, known_starts.contains(agent.id()));
  }
  return facts;
}

AgentFactsMap FactsOf(const Mission& mission) {
  AgentFactsMap facts;
  for (const MissionAgent& agent : mission.agents) {
    facts[agent.id] = AgentFacts{.agent = agent.id,
                                 .is_base_station = agent.is_base_station,
                                 .start = agent.start,
                                 .start_sigma_m = agent.start_sigma_m,
                                 .start_sigma_rad = agent.start_sigma_rad,
                                 .antenna_m = agent.antenna_m};
  }
  return facts;
}

}  // namespace moondb
