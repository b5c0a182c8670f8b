// StandaloneGraph: a pose graph read from a file, without a team. Every factor is used as written in the file.
//
// The cost of the graph is that of the public benchmarks (SE-Sync, CORA), without the factor 1/2 and without a loss:
//
//   F = sum_steps     kappa |R_j - R_i R_ij|^2 + tau |p_j - p_i - R_i t_ij|^2
//     + sum_sightings tau |l - p_i - R_i t_il|^2
//     + sum_ranges    (|p_a - p_b| - r)^2 / variance
//
// A prior is a step or sighting from an additional pose, the origin, which is fixed at the identity (kOriginKey).
//
// The isotropic weights are computed from a covariance matrix as in the code of SE-Sync and CORA. In d dimensions tau =
// d / trace(translation covariance). In space kappa = 3 / (2 trace(rotation covariance)), in the plane kappa = 1 /
// (variance of the yaw).
//
// Nodes are poses and points (landmarks). In 2-D all nodes lie in the plane z = 0.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

struct PlainNode {
  NodeKey key;  // The key of a g2o vertex consists of agent 0 and the vertex id.
  Pose vertex;  // Pose in the file: ground truth or a solution.
  // Time of the node in ns, or index of the node in a file without timestamps. Used only for ordering.
  std::int64_t time = 0;
  bool is_point = false;
  bool is_fixed = false;  // True if the node is held at `vertex`.
};

// `from` and `to` are indices in StandaloneGraph::nodes.
struct PlainStep {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose from_from_to;
  double kappa = 1;
  double tau = 1;
};

struct PlainSighting {
  std::size_t from = 0;
  std::size_t to = 0;  // Index of a point, or of a pose of which only the position is measured.
  Eigen::Vector3d from_point_m = Eigen::Vector3d::Zero();
  double tau = 1;
};

struct PlainRange {
  std::size_t from = 0;
  std::size_t to = 0;
  double range_m = 0;
  double sigma_m = 1;
};

// Key of the origin in a graph with priors. No node of a file has this key.
inline constexpr NodeKey kOriginKey{kAgentIdMax, 0};

struct StandaloneGraph {
  bool is_planar = false;
  std::vector<PlainNode> nodes;  // Poses, then points; each sorted by key.
  std::vector<PlainStep> steps;
  std::vector<PlainSighting> sightings;
  std::vector<PlainRange> ranges;
};

// Converts the contents of a file. Landmarks are free unless `fixed` names them. Requires: no range joins a node to
// itself (the file reader refuses such a range).
StandaloneGraph ToStandaloneGraph(const Pyfg& pyfg, const std::set<NodeKey>& fixed = {});
StandaloneGraph ToStandaloneGraph(const G2o& g2o);

}  // namespace moondb
