#include "actors/pgo/standalone_graph.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "model/check.h"

namespace moondb {

namespace {

// Returns a step with the isotropic weights tau and kappa of `covariance` (standalone_graph.h).
PlainStep StepOf(const Pose& from_from_to, const Matrix6d& covariance, bool is_planar) {
  PlainStep step;
  step.from_from_to = from_from_to;
  if (is_planar) {
    step.tau = 2 / covariance.topLeftCorner<2, 2>().trace();
    step.kappa = 1 / covariance(5, 5);
  } else {
    step.tau = 3 / covariance.topLeftCorner<3, 3>().trace();
    step.kappa = 3 / (2 * covariance.bottomRightCorner<3, 3>().trace());
  }
  return step;
}

// Returns the covariance of an information matrix. Inverts the translation and rotation blocks separately, like the
// code of SE-Sync and CORA.
Matrix6d BlockInverse(const Matrix6d& information, bool is_planar) {
  Matrix6d covariance = Matrix6d::Identity();
  if (is_planar) {
    covariance.topLeftCorner<2, 2>() = information.topLeftCorner<2, 2>().inverse();
    covariance(5, 5) = 1 / information(5, 5);
  } else {
    covariance.topLeftCorner<3, 3>() = information.topLeftCorner<3, 3>().inverse();
    covariance.bottomRightCorner<3, 3>() = information.bottomRightCorner<3, 3>().inverse();
  }
  return covariance;
}

std::set<std::uint64_t> IdsOf(const std::vector<G2oEdge>& edges) {
  std::set<std::uint64_t> ids;
  for (const G2oEdge& edge : edges) ids.insert({edge.from, edge.to});
  return ids;
}

void SortByKey(std::vector<PlainNode>& nodes) {
  std::stable_sort(nodes.begin(), nodes.end(), [](const PlainNode& a, const PlainNode& b) {
    return std::pair(a.is_point, a.key) < std::pair(b.is_point, b.key);
  });
}

std::map<NodeKey, std::size_t> PlacesOf(const std::vector<PlainNode>& nodes) {
  std::map<NodeKey, std::size_t> places;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    Check(places.emplace(nodes[i].key, i).second, "every node of a graph has its own key");
  }
  return places;
}

// Adds a prior of a position as a sighting, and a prior with a rotation as a step.
void AddPrior(const NodePrior& prior, std::size_t origin, std::size_t node, StandaloneGraph& graph) {
  if (prior.extent == PriorExtent::kPosition) {
    const int size = graph.is_planar ? 2 : 3;
    const double tau = size / prior.covariance.topLeftCorner(size, size).trace();
    graph.sightings.push_back({origin, node, prior.map_from_node.position_m, tau});
    return;
  }
  Matrix6d covariance = prior.covariance;
  if (prior.extent == PriorExtent::kPositionYaw) covariance(5, 5) = prior.covariance(3, 3);
  PlainStep step = StepOf(prior.map_from_node, covariance, graph.is_planar);
  step.from = origin;
  step.to = node;
  graph.steps.push_back(step);
}

}  // namespace

StandaloneGraph ToStandaloneGraph(const Pyfg& pyfg, const std::set<NodeKey>& fixed) {
  StandaloneGraph graph;
  graph.is_planar = pyfg.is_planar;
  for (const GraphNode& node : pyfg.graph.nodes) {
    graph.nodes.push_back({node.key, node.map_from_node, node.timestamp_ns, false, fixed.contains(node.key)});
  }
  for (const PyfgLandmark& landmark : pyfg.landmarks) {
    const Pose place{landmark.position_m, Eigen::Quaterniond::Identity()};
    graph.nodes.push_back({landmark.key, place, landmark.timestamp_ns.value_or(0), true, fixed.contains(landmark.key)});
  }
  if (!pyfg.graph.priors.empty()) graph.nodes.push_back({kOriginKey, Pose{}, 0, false, true});
  SortByKey(graph.nodes);
  const std::map<NodeKey, std::size_t> places = PlacesOf(graph.nodes);
  for (const NodePrior& prior : pyfg.graph.priors) {
    AddPrior(prior, places.at(kOriginKey), places.at(prior.node), graph);
  }
  for (const OdometryEdge& edge : pyfg.graph.odometry) {
    PlainStep step = StepOf(edge.from_from_to, edge.covariance, pyfg.is_planar);
    step.from = places.at(edge.from);
    step.to = places.at(edge.to);
    graph.steps.push_back(step);
  }
  for (const PyfgSighting& sighting : pyfg.sightings) {
    const int size = pyfg.is_planar ? 2 : 3;
    const double tau = size / sighting.covariance.topLeftCorner(size, size).trace();
    graph.sightings.push_back({places.at(sighting.from), places.at(sighting.to), sighting.from_point_m, tau});
  }
  for (const RangeEdge& range : pyfg.graph.ranges) {
    graph.ranges.push_back({places.at(range.from), places.at(range.to), range.range_m, std::sqrt(range.variance_m2)});
  }
  return graph;
}

StandaloneGraph ToStandaloneGraph(const G2o& g2o) {
  StandaloneGraph graph;
  graph.is_planar = g2o.is_planar;
  const std::set<std::uint64_t> fixed(g2o.fixed.begin(), g2o.fixed.end());
  for (const G2oVertex& vertex : g2o.vertices) {
    const auto time = static_cast<std::int64_t>(graph.nodes.size());
    graph.nodes.push_back({NodeKey{0, vertex.id}, vertex.map_from_vertex, time, false, fixed.contains(vertex.id)});
  }
  if (g2o.vertices.empty()) {
    for (const std::uint64_t id : IdsOf(g2o.edges)) {
      const auto time = static_cast<std::int64_t>(graph.nodes.size());
      graph.nodes.push_back({NodeKey{0, id}, Pose{}, time, false, fixed.contains(id)});
    }
  }
  if (!g2o.priors.empty()) graph.nodes.push_back({kOriginKey, Pose{}, 0, false, true});
  SortByKey(graph.nodes);
  const std::map<NodeKey, std::size_t> places = PlacesOf(graph.nodes);
  for (const G2oPrior& prior : g2o.priors) {
    NodePrior converted;
    converted.extent = prior.extent;
    converted.map_from_node = prior.map_from_vertex;
    converted.covariance = BlockInverse(prior.information, g2o.is_planar);
    AddPrior(converted, places.at(kOriginKey), places.at({0, prior.id}), graph);
  }
  for (const G2oEdge& edge : g2o.edges) {
    PlainStep step = StepOf(edge.from_from_to, BlockInverse(edge.information, g2o.is_planar), g2o.is_planar);
    step.from = places.at({0, edge.from});
    step.to = places.at({0, edge.to});
    graph.steps.push_back(step);
  }
  return graph;
}

}  // namespace moondb
