#include "actors/registration/rover_track.h"

#include <algorithm>

#include "model/check.h"

namespace moondb {

RoverTrack::RoverTrack(const std::vector<Step>& steps) {
  Check(!steps.empty(), "a track has a node");
  nodes_.reserve(steps.size());
  for (const Step& step : steps) {
    Node node{step.node, step.odom_from_node, 0, {}};
    if (!nodes_.empty()) {
      const Node& before = nodes_.back();
      const Eigen::Vector2d p = step.odom_from_node.position_m();
      const double q = step.covariance(2, 2);
      node.path_m = before.path_m + (p - before.odom_from_node.position_m()).norm();
      node.sums = before.sums;
      node.sums.position += step.covariance.topLeftCorner<2, 2>();
      node.sums.q += q;
      node.sums.q_p += q * p;
      node.sums.q_p_p += q * p * p.transpose();
    }
    nodes_.push_back(node);
  }
}

// A yaw error at p moves the target t by J (t - p), with J the turn by 90 degrees.
Eigen::Matrix3d RoverTrack::CovarianceOf(std::size_t from, std::size_t to, const Eigen::Vector2d& target_m) const {
  const Sums& first = nodes_[std::min(from, to)].sums;
  const Sums& last = nodes_[std::max(from, to)].sums;
  const double q = last.q - first.q;
  const Eigen::Vector2d q_p = last.q_p - first.q_p;
  const Eigen::Matrix2d q_p_p = last.q_p_p - first.q_p_p;
  const Eigen::Matrix2d about_target =
      q * target_m * target_m.transpose() - target_m * q_p.transpose() - q_p * target_m.transpose() + q_p_p;
  const Eigen::Matrix2d turn = (Eigen::Matrix2d() << 0, -1, 1, 0).finished();
  const Eigen::Vector2d moved_m = nodes_[to].odom_from_node.position_m() - nodes_[from].odom_from_node.position_m();
  Eigen::Matrix3d covariance;
  covariance.topLeftCorner<2, 2>() = last.position - first.position + turn * about_target * turn.transpose() +
                                     kScaleSigma * kScaleSigma * moved_m * moved_m.transpose();
  covariance.topRightCorner<2, 1>() = turn * (q * target_m - q_p);
  covariance.bottomLeftCorner<1, 2>() = covariance.topRightCorner<2, 1>().transpose();
  covariance(2, 2) = q;
  return covariance;
}

}  // namespace moondb
