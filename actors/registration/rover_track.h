// RoverTrack: the raw odometry of one rover in the plane, with the covariance between any two of its nodes.
//
// A track is unbroken: the odometry edge of each step is known, and no step is longer than kStepMax_m. Immutable and
// usable on any thread.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "actors/registration/planar_offset.h"
#include "model/ids.h"

namespace moondb {

class RoverTrack {
 public:
  static constexpr double kStepMax_m = 20;
  // Standard deviation of the scale error of odometry, as a part of the distance.
  static constexpr double kScaleSigma = 0.02;

  struct Step {
    NodeKey node;
    PlanarOffset odom_from_node;  // Raw pose of the node, in the frame `odom` of the rover.
    // Covariance of the step from the previous node: x and y (m) along the axes of `odom`, and yaw (rad). Not used for
    // the first node.
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };

  // Requires: at least one step.
  explicit RoverTrack(const std::vector<Step>& steps);

  std::size_t size() const { return nodes_.size(); }
  const NodeKey& node(std::size_t index) const { return nodes_[index].node; }
  const PlanarOffset& odom_from_node(std::size_t index) const { return nodes_[index].odom_from_node; }
  // Length of the path from the first node.
  double path_m(std::size_t index) const { return nodes_[index].path_m; }

  // Returns the covariance of node `to` relative to node `from`: position (m) along the axes of `odom`, and yaw (rad).
  // The position is that of a point fixed to node `to`, which lies at `target_m` in `odom`.
  Eigen::Matrix3d CovarianceOf(std::size_t from, std::size_t to, const Eigen::Vector2d& target_m) const;

 private:
  // Sums over the steps up to a node. p: where a step ends, q: the variance of its yaw.
  struct Sums {
    Eigen::Matrix2d position = Eigen::Matrix2d::Zero();
    double q = 0;
    Eigen::Vector2d q_p = Eigen::Vector2d::Zero();
    Eigen::Matrix2d q_p_p = Eigen::Matrix2d::Zero();
  };

  struct Node {
    NodeKey node;
    PlanarOffset odom_from_node;
    double path_m = 0;
    Sums sums;
  };

  std::vector<Node> nodes_;
};

}  // namespace moondb
