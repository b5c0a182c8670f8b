#include "actors/pgo/map_frame.h"

#include <algorithm>
#include <map>

namespace moondb {

namespace {

// Returns whether a range joins a rover to a base station whose position is known.
bool HasRangeToBase(const PoseGraph& graph, const AgentFactsMap& agents) {
  const auto is_base = [&agents](AgentId agent) {
    const auto facts = agents.find(agent);
    return facts != agents.end() && facts->second.is_base_station && facts->second.start;
  };
  return std::any_of(graph.ranges.begin(), graph.ranges.end(),
                     [&](const RangeEdge& range) { return is_base(range.from.agent) || is_base(range.to.agent); });
}

// Returns the first node of each rover that has a node.
std::map<AgentId, GraphNode> FindFirstNodes(const PoseGraph& graph, const AgentFactsMap& agents) {
  std::map<AgentId, GraphNode> first;
  for (const GraphNode& node : graph.nodes) {
    const auto facts = agents.find(node.key.agent);
    if (facts == agents.end() || facts->second.is_base_station) continue;
    const auto [entry, is_new] = first.try_emplace(node.key.agent, node);
    if (!is_new && node.key.index < entry->second.key.index) entry->second = node;
  }
  return first;
}

}  // namespace

std::optional<AgentId> ChooseMapFrame(const PoseGraph& graph, const KnownGraph& known, AgentFactsMap& agents) {
  const std::map<AgentId, GraphNode> first_nodes = FindFirstNodes(graph, agents);
  const bool has_start = std::any_of(first_nodes.begin(), first_nodes.end(),
                                     [&](const auto& first) { return agents.at(first.first).start.has_value(); });
  if (first_nodes.empty() || has_start || !graph.priors.empty() || HasRangeToBase(graph, agents)) return std::nullopt;
  const auto placed = std::find_if(first_nodes.begin(), first_nodes.end(), [&known](const auto& first) {
    const NodeKey& node = first.second.key;
    return known.FindPublished(node) != nullptr && !known.IsPublishedUnplaced(node);
  });
  const auto& [agent, node] = placed == first_nodes.end() ? *first_nodes.begin() : *placed;
  const Pose* const published = placed == first_nodes.end() ? nullptr : known.FindPublished(node.key);
  AgentFacts& facts = agents.at(agent);
  facts.start = published == nullptr ? node.map_from_node : *published;
  facts.start_index = node.key.index;
  return agent;
}

}  // namespace moondb
