#include "apps/moonctl/graph_import.h"

#include <algorithm>
#include <optional>
#include <set>

#include "apps/moonctl/team_letters.h"
#include "model/team_member.h"

namespace moondb {
namespace {

class Importer {
 public:
  Importer(const proto::TeamConfig& team, const Pyfg& pyfg)
      : team_(team), pyfg_(pyfg), agents_(AgentsByLetterOfAnyCase(team)), base_(BaseStationOf(team)) {}

  Result<GraphImport> Run() {
    AddLandmarks();
    if (auto added = AddNodes(); !added) return tl::unexpected(added.error());
    for (const OdometryEdge& edge : pyfg_.graph.odometry) {
      const NodeKey from = *Translate(edge.from);
      const NodeKey to = *Translate(edge.to);
      if (from.agent != to.agent || IsLoopClosure(edge)) {
        const LoopClosure closure{from, to, edge.timestamp_ns, edge.from_from_to, edge.covariance, SourceOf(from, to)};
        Add(from.agent, ToRecord(closure));
        continue;
      }
      OdometryEdge translated = edge;
      translated.from = from;
      translated.to = to;
      Add(from.agent, ToRecord(translated));
    }
    for (const RangeEdge& edge : pyfg_.graph.ranges) {
      RangeEdge translated = edge;
      const auto from = Translate(edge.from);
      const auto to = Translate(edge.to);
      if (!from || !to || !known_.contains(*from) || !known_.contains(*to) || from->agent == to->agent) {
        ++import_.left_out_count;
        continue;
      }
      translated.from = *from;
      translated.to = *to;
      Add(translated.from.agent, ToRecord(translated));
    }
    for (NodePrior prior : pyfg_.graph.priors) {
      const auto node = Translate(prior.node);
      if (!node || node->agent == base_ || !known_.contains(*node)) {
        ++import_.left_out_count;
        continue;
      }
      prior.node = *node;
      prior.source = SourceOf(*node, *node);
      Add(node->agent, ToRecord(prior));
    }
    import_.left_out_count += pyfg_.sightings.size();
    return std::move(import_);
  }

 private:
  std::optional<NodeKey> Translate(const NodeKey& key) const {
    const auto found = agents_.find(key.agent);
    if (found == agents_.end()) return std::nullopt;
    return NodeKey{found->second, key.index};
  }

  // Returns the source of the next loop closure between two nodes, or of the next prior of a node (`from` and `to` are
  // then equal). A file may hold several, and an agent accepts one of each source.
  std::string SourceOf(const NodeKey& from, const NodeKey& to) {
    const int count = ++counts_[{from, to}];
    return count == 1 ? kImportSource : kImportSource + ("_" + std::to_string(count));
  }

  // Returns true if the file has a node between the nodes of the edge. Agents do not accept such an edge as odometry.
  bool IsLoopClosure(const OdometryEdge& edge) const {
    const auto [first, last] = std::minmax(*Translate(edge.from), *Translate(edge.to));
    const auto next = known_.upper_bound(first);
    return next != known_.end() && *next < last;
  }

  void Add(AgentId agent, proto::Record record) {
    import_.counts.Add(record);
    import_.records[agent].push_back(std::move(record));
  }

  // Turns the landmark with the base station's letter into the base station's node. Leaves out other landmarks, because
  // each node belongs to an agent.
  void AddLandmarks() {
    for (const PyfgLandmark& landmark : pyfg_.landmarks) {
      const auto key = Translate(landmark.key);
      if (!key || key->agent != base_ || base_ == 0) {
        ++import_.left_out_count;
        continue;
      }
      GraphNode node;
      node.key = *key;
      node.timestamp_ns = landmark.timestamp_ns.value_or(0);
      node.map_from_node.position_m = landmark.position_m;
      known_.insert(*key);
      Add(base_, ToRecord(node));
    }
  }

  Result<void> AddNodes() {
    std::map<AgentId, std::vector<const GraphNode*>> by_agent;
    for (const GraphNode& node : pyfg_.graph.nodes) by_agent[node.key.agent].push_back(&node);
    // For each node, the odometry edge from the nearest earlier node. Other edges to the node are loop closures.
    std::map<NodeKey, const OdometryEdge*> steps;
    for (const OdometryEdge& edge : pyfg_.graph.odometry) {
      if (edge.from.agent != edge.to.agent || edge.to < edge.from) continue;
      const OdometryEdge*& step = steps[edge.to];
      if (step == nullptr || step->from < edge.from) step = &edge;
    }
    std::map<AgentId, AgentId> letters;
    for (auto& [letter, nodes] : by_agent) {
      const std::string name(1, LetterOfAgent(letter));
      const auto agent = agents_.find(letter);
      if (agent == agents_.end()) {
        return Fail(ErrorCode::kInvalid, "no agent stands for the letter " + name + ": " + LettersText(team_));
      }
      const auto [other, is_new] = letters.emplace(agent->second, letter);
      if (!is_new) {
        return Fail(ErrorCode::kInvalid, std::string("the letters ") + LetterOfAgent(other->second) + " and " + name +
                                             " stand for the same agent: use one of them");
      }
      std::sort(nodes.begin(), nodes.end(), [](const auto* a, const auto* b) { return a->key < b->key; });
      if (auto added = AddRover(nodes, steps); !added) return added;
    }
    return {};
  }

  Result<void> AddRover(const std::vector<const GraphNode*>& nodes,
                        const std::map<NodeKey, const OdometryEdge*>& steps) {
    std::map<NodeKey, Pose> raw{{nodes.front()->key, nodes.front()->map_from_node}};
    for (const GraphNode* node : nodes) {
      if (!raw.contains(node->key)) {
        const auto step = steps.find(node->key);
        if (step == steps.end() || !raw.contains(step->second->from)) {
          return Fail(ErrorCode::kInvalid, std::string("no odometry edge from an earlier node leads to node ") +
                                               LetterOfAgent(node->key.agent) + std::to_string(node->key.index));
        }
        raw[node->key] = raw.at(step->second->from) * step->second->from_from_to;
      }
      GraphNode translated = *node;
      translated.key = *Translate(node->key);
      translated.map_from_node = raw.at(node->key);
      known_.insert(translated.key);
      Add(translated.key.agent, ToRecord(translated));
    }
    return {};
  }

  const proto::TeamConfig& team_;
  const Pyfg& pyfg_;
  const std::map<AgentId, AgentId> agents_;
  const AgentId base_;
  std::set<NodeKey> known_;
  std::map<std::pair<NodeKey, NodeKey>, int> counts_;
  GraphImport import_;
};

}  // namespace

void GraphCounts::Add(const proto::Record& record) {
  const proto::PoseGraphEdge& edge = record.pose_graph_edge();
  if (record.has_pose_graph_node()) {
    ++nodes;
  } else if (record.has_pose_prior()) {
    ++priors;
  } else if (edge.has_range()) {
    ++ranges;
  } else if (edge.source().empty()) {
    ++odometry;
  } else {
    ++closures;
  }
}

Result<GraphImport> PrepareImport(const proto::TeamConfig& team, const Pyfg& pyfg) {
  return Importer(team, pyfg).Run();
}

}  // namespace moondb
