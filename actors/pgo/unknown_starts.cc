#include "actors/pgo/unknown_starts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "actors/pgo/arrangement.h"
#include "actors/pgo/connected_parts.h"

namespace moondb {

namespace {

constexpr int kStarts = 60;
constexpr std::size_t kArrangementsMax = 4;
// An arrangement is ruled out if its cost exceeds the lowest cost by more than this value. A smaller excess may vanish
// in a full solve, in which the bodies are no longer rigid.
constexpr double kRuledOutCost = 30;

// Returns the team's ranges as a graph whose nodes are the antennas.
StandaloneGraph AntennaGraph(const CheckedGraph& graph) {
  StandaloneGraph antennas;
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

std::map<AgentId, std::size_t> CountRanges(const CheckedGraph& graph) {
  std::map<AgentId, std::size_t> counts;
  for (const CheckedRange& range : graph.ranges) {
    ++counts[range.edge->from.agent];
    ++counts[range.edge->to.agent];
  }
  return counts;
}

// A team is a set of agents that ranges connect, directly or through other agents. Returns, for each agent, the lowest
// agent id in its team.
std::map<AgentId, AgentId> FindTeams(const CheckedGraph& graph) {
  std::map<AgentId, std::size_t> places;
  for (const CheckedNode& node : graph.nodes) places.try_emplace(node.key.agent, places.size());
  ConnectedParts parts(places.size());
  for (const CheckedRange& range : graph.ranges) {
    parts.Join(places.at(range.edge->from.agent), places.at(range.edge->to.agent));
  }
  std::vector<AgentId> agents;
  for (const auto& [agent, place] : places) agents.push_back(agent);
  std::map<AgentId, AgentId> teams;
  for (const auto& [agent, place] : places) teams[agent] = agents[parts.HeadOf(place)];
  return teams;
}

// Returns the rovers of `unknown` that stay in place. The other rovers of `unknown` are arranged around them.
std::set<AgentId> FindStanding(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                               const std::vector<StartPrior>& starts, const std::vector<std::size_t>& unknown,
                               const InitialValues& initial) {
  const std::map<AgentId, AgentId> teams = FindTeams(graph);
  std::map<AgentId, std::size_t> ranges = CountRanges(graph);
  std::set<AgentId> placed_teams;  // Teams with a known place, each given by its lowest agent id.
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (starts[i].is_configured) placed_teams.insert(teams.at(rovers[i].agent));
  }
  for (const CheckedNode& node : graph.nodes) {
    const bool leaves_yaw_free = initial.has_warm && !FixedNodesHoldYaw(graph);
    if (node.is_fixed && !leaves_yaw_free) placed_teams.insert(teams.at(node.key.agent));
  }
  std::map<AgentId, AgentId> standing;  // For each team without a known place: the rover that stays in place.
  for (const std::size_t i : unknown) {
    const AgentId agent = rovers[i].agent;
    if (placed_teams.contains(teams.at(agent))) continue;
    const auto [best, is_first] = standing.try_emplace(teams.at(agent), agent);
    if (!is_first && ranges[agent] > ranges[best->second]) best->second = agent;
  }
  std::set<AgentId> result;
  for (const auto& [team, agent] : standing) result.insert(agent);
  return result;
}

// Input of ArrangeParts. The rovers to arrange are bodies; all other nodes are placed.
struct Bodies {
  std::vector<bool> placed;
  std::vector<std::size_t> heads;
};

Bodies FindBodies(std::size_t node_count, const std::vector<Rover>& rovers, const std::vector<std::size_t>& unknown,
                  const std::set<AgentId>& standing) {
  Bodies bodies;
  bodies.placed.assign(node_count, true);
  for (std::size_t node = 0; node < node_count; ++node) bodies.heads.push_back(node);
  for (const std::size_t i : unknown) {
    if (standing.contains(rovers[i].agent)) continue;
    for (std::size_t k = 0; k < rovers[i].count; ++k) {
      bodies.placed[rovers[i].first + k] = false;
      bodies.heads[rovers[i].first + k] = rovers[i].first;
    }
  }
  return bodies;
}

// Returns `initial` with the nodes of each body at their arranged poses.
InitialValues Arranged(InitialValues initial, const Bodies& bodies, const Arrangement& arrangement) {
  for (std::size_t node = 0; node < bodies.placed.size(); ++node) {
    const auto body = arrangement.map_from_body.find(bodies.heads[node]);
    if (bodies.placed[node] || body == arrangement.map_from_body.end()) continue;
    initial.poses[node] = body->second * initial.poses[node];
  }
  return initial;
}

bool IsSamePlace(const InitialValues& a, const InitialValues& b) {
  for (std::size_t node = 0; node < a.poses.size(); ++node) {
    if ((a.poses[node].position_m - b.poses[node].position_m).norm() > kApart_m) return false;
  }
  return true;
}

}  // namespace

bool HasWarmNode(const Rover& rover, const InitialValues& initial) {
  const auto first = initial.is_warm.begin() + static_cast<std::ptrdiff_t>(rover.first);
  return std::find(first, first + static_cast<std::ptrdiff_t>(rover.count), true) !=
         first + static_cast<std::ptrdiff_t>(rover.count);
}

std::vector<std::size_t> FindUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts) {
  const std::map<AgentId, std::size_t> ranges = CountRanges(graph);
  std::vector<std::size_t> unknown;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (!starts[i].is_configured && ranges.contains(rovers[i].agent)) unknown.push_back(i);
  }
  return unknown;
}

std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<StartPrior>& starts,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial,
                                                const std::function<bool()>& stop_requested) {
  const Bodies bodies =
      FindBodies(graph.nodes.size(), rovers, unknown, FindStanding(graph, rovers, starts, unknown, initial));
  PlainState state;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    const Eigen::Vector3d antenna_m = initial.poses[node] * AntennaOf(agents, graph.nodes[node].key.agent);
    state.push_back(ToBlock(Pose{antenna_m, Eigen::Quaterniond::Identity()}));
  }
  const bool is_warm =
      std::any_of(unknown.begin(), unknown.end(), [&](std::size_t i) { return HasWarmNode(rovers[i], initial); });
  ArrangementOptions options;
  options.freedom = BodyFreedom::kUpright;
  options.starts = kStarts;
  options.kept = kArrangementsMax;
  options.begins_as_given = is_warm;
  options.stop_requested = stop_requested;
  const StandaloneGraph antennas = AntennaGraph(graph);
  const ActiveNodes active(graph.nodes.size(), true);
  const std::vector<Arrangement> arrangements =
      ArrangeParts(antennas, active, bodies.placed, bodies.heads, state, options);

  std::vector<InitialValues> initial_values;
  for (const Arrangement& arrangement : arrangements) {
    if (arrangement.map_from_body.empty()) continue;
    if (is_warm && arrangement.cost > arrangements.front().cost + kRuledOutCost) continue;
    InitialValues arranged = Arranged(initial, bodies, arrangement);
    if (!is_warm || !IsSamePlace(arranged, initial)) initial_values.push_back(std::move(arranged));
  }
  return initial_values;
}

}  // namespace moondb
