#include "bench/redraw.h"

#include <algorithm>
#include <map>
#include <vector>

#include "apps/moondb_mission/measurement.h"

namespace moondb {
namespace {

std::vector<GraphNode> TrueNodes(const Mission& mission, AgentId agent) {
  std::vector<GraphNode> nodes;
  for (const GraphNode& node : mission.graph.nodes) {
    if (node.key.agent != agent) continue;
    nodes.push_back(node);
    nodes.back().map_from_node = mission.truth.at(node.key);
  }
  std::sort(nodes.begin(), nodes.end(), [](const GraphNode& a, const GraphNode& b) { return a.key < b.key; });
  return nodes;
}

}  // namespace

Mission Redraw(const Mission& mission, std::uint64_t seed) {
  Mission drawn = mission;
  drawn.graph.odometry.clear();
  Random starts = Random::Stream(seed, 1);
  Random odometry = Random::Stream(seed, 2);
  Random ranges = Random::Stream(seed, 3);
  std::map<NodeKey, Pose> raw;
  std::size_t node_count = mission.truth.size();
  std::int64_t period_ns = 1;
  for (MissionAgent& agent : drawn.agents) {
    if (agent.is_base_station) continue;
    const std::vector<GraphNode> nodes = TrueNodes(mission, agent.id);
    node_count = std::min(node_count, nodes.size());
    if (nodes.size() > 1) period_ns = nodes[1].timestamp_ns - nodes[0].timestamp_ns;
    agent.start = nodes.front().map_from_node;
    agent.start.position_m.x() += agent.start_sigma_m * starts.Normal();
    agent.start.position_m.y() += agent.start_sigma_m * starts.Normal();
    agent.start = agent.start * Pose::FromPlanar(0, 0, agent.start_sigma_rad * starts.Normal());
    raw[nodes.front().key] = agent.start;
    for (const OdometryEdge& step : MeasureOdometry(nodes, {}, odometry)) {
      raw[step.to] = raw.at(step.from) * step.from_from_to;
      drawn.graph.odometry.push_back(step);
    }
  }
  for (GraphNode& node : drawn.graph.nodes) {
    if (const auto pose = raw.find(node.key); pose != raw.end()) node.map_from_node = pose->second;
  }
  drawn.graph.ranges = MeasureRanges(drawn.agents, mission.truth, static_cast<int>(node_count), period_ns, {}, ranges);
  return drawn;
}

}  // namespace moondb
