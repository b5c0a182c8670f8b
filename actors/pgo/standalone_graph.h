// StandaloneGraph: a pose graph by itself, as a file holds it: every factor counts as it is written, nobody knows of a
// team.
//
// Its cost is that of the public benchmarks (SE-Sync, CORA), without a half and without any loss:
//
//   F = sum_steps     kappa |R_j - R_i R_ij|^2 + tau |p_j - p_i - R_i t_ij|^2
//     + sum_sightings tau |l - p_i - R_i t_il|^2
//     + sum_ranges    (|p_a - p_b| - r)^2 / variance
//
// with the isotropic weights that those codes read from a matrix: tau = d / trace(translation covariance) in d
// dimensions, kappa = 3 / (2 trace(rotation covariance)) in space and 1 / (yaw's variance) in the plane.
//
// Nodes are poses and points (landmarks); in 2-D all lie in the plane z = 0. Plain values.
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
  NodeKey key;            // Of a g2o vertex: agent 0 and its id.
  Pose vertex;            // As the file has it: the truth, or somebody's solution.
  std::int64_t time = 0;  // Order in which nodes came: ns, or the place in a file without stamps.
  bool is_point = false;
  bool is_fixed = false;  // Stands at `vertex`.
};

// Ends are places in StandaloneGraph::nodes.
struct PlainStep {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose from_from_to;
  double kappa = 1;
  double tau = 1;
};

struct PlainSighting {
  std::size_t from = 0;
  std::size_t to = 0;  // A point.
  Eigen::Vector3d from_point_m = Eigen::Vector3d::Zero();
  double tau = 1;
};

struct PlainRange {
  std::size_t from = 0;
  std::size_t to = 0;
  double range_m = 0;
  double sigma_m = 1;
};

struct StandaloneGraph {
  bool is_planar = false;
  std::vector<PlainNode> nodes;  // Poses, then points, each by key.
  std::vector<PlainStep> steps;
  std::vector<PlainSighting> sightings;
  std::vector<PlainRange> ranges;
};

// Landmarks are free unless `fixed` names them; a range of a node with itself is not there (the reader refuses it).
StandaloneGraph ToStandaloneGraph(const Pyfg& pyfg, const std::set<NodeKey>& fixed = {});
StandaloneGraph ToStandaloneGraph(const G2o& g2o);

}  // namespace moondb
