#include "actors/pgo/unknown_starts.h"

#include <cmath>

#include "actors/pgo/arrangement.h"

namespace moondb {

namespace {

constexpr int kStarts = 60;
constexpr std::size_t kArrangementsMax = 4;

// The team's ranges as those of a graph whose nodes are the antennas.
PlainGraph AntennaGraph(const CheckedGraph& graph) {
  PlainGraph antennas;
  for (const CheckedNode& node : graph.nodes) {
    PlainNode plain;
    plain.key = node.key;
    plain.time = static_cast<std::int64_t>(node.key.index);
    antennas.nodes.push_back(plain);
  }
  for (const CheckedRange& range : graph.ranges) {
    antennas.ranges.push_back({range.from, range.to, range.edge->range_m, std::sqrt(range.edge->variance_m2)});
  }
  return antennas;
}

}  // namespace

std::vector<std::size_t> FindUnknownRovers(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
                                           const InitialValues& initial) {
  std::vector<std::size_t> unknown;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    bool is_known = starts[i].is_configured;
    for (std::size_t node = 0; node < rovers[i].count && !is_known; ++node) {
      is_known = initial.is_warm[rovers[i].first + node];
    }
    if (!is_known) unknown.push_back(i);
  }
  return unknown;
}

std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial) {
  const std::size_t count = graph.nodes.size();
  std::vector<bool> placed(count, true);
  std::vector<std::size_t> heads(count);
  for (std::size_t node = 0; node < count; ++node) heads[node] = node;
  for (const std::size_t i : unknown) {
    for (std::size_t k = 0; k < rovers[i].count; ++k) {
      placed[rovers[i].first + k] = false;
      heads[rovers[i].first + k] = rovers[i].first;
    }
  }
  PlainState state;
  for (std::size_t node = 0; node < count; ++node) {
    const Eigen::Vector3d antenna_m = initial.poses[node] * AntennaOf(agents, graph.nodes[node].key.agent);
    state.push_back(ToBlock(Pose{antenna_m, Eigen::Quaterniond::Identity()}));
  }
  ArrangementOptions options;
  options.freedom = BodyFreedom::kUpright;
  options.starts = kStarts;
  options.kept = kArrangementsMax;
  const PlainGraph antennas = AntennaGraph(graph);
  const ActiveNodes active(count, true);

  std::vector<InitialValues> beginnings = {initial};
  for (const Arrangement& arrangement : ArrangeParts(antennas, active, placed, heads, state, options)) {
    if (arrangement.map_from_body.empty()) continue;
    InitialValues& arranged = beginnings.emplace_back(initial);
    for (std::size_t node = 0; node < count; ++node) {
      const auto body = arrangement.map_from_body.find(heads[node]);
      if (!placed[node] && body != arrangement.map_from_body.end()) {
        arranged.poses[node] = body->second * initial.poses[node];
      }
    }
  }
  return beginnings;
}

}  // namespace moondb
