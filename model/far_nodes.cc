#include "model/far_nodes.h"

#include <algorithm>

namespace moondb {
namespace {

constexpr double kFar_m = 10'000;
constexpr double kFarTrajectories = 10;

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using Positions = std::vector<std::pair<NodeKey, Eigen::Vector3d>>;

double MedianOfAxis(Positions::const_iterator begin, Positions::const_iterator end, int axis) {
  std::vector<double> coordinates;
  for (auto position = begin; position != end; ++position) coordinates.push_back(position->second[axis]);
  return MedianOf(std::move(coordinates));
}

// Requires: `positions_m` is sorted by node, and not empty.
Eigen::Vector3d MedianPosition(const Positions& positions_m) {
  Positions agents_m;  // Median position of each agent.
  for (auto begin = positions_m.begin(); begin != positions_m.end();) {
    const auto end = std::find_if(begin, positions_m.end(),
                                  [&](const auto& position) { return position.first.agent != begin->first.agent; });
    agents_m.emplace_back(begin->first, Eigen::Vector3d());
    for (int axis = 0; axis < 3; ++axis) agents_m.back().second[axis] = MedianOfAxis(begin, end, axis);
    begin = end;
  }
  constexpr std::size_t kMajorityAgents = 3;  // With two agents, nothing says which one is right.
  const Positions& all_m = agents_m.size() < kMajorityAgents ? positions_m : agents_m;
  Eigen::Vector3d median_m;
  for (int axis = 0; axis < 3; ++axis) median_m[axis] = MedianOfAxis(all_m.begin(), all_m.end(), axis);
  return median_m;
}

double LongestTrajectory(const std::vector<std::pair<NodeKey, Eigen::Vector3d>>& positions_m) {
  double longest_m = 0;
  std::vector<double> steps_m;
  for (std::size_t i = 1; i <= positions_m.size(); ++i) {
    const bool goes_on = i < positions_m.size() && positions_m[i].first.agent == positions_m[i - 1].first.agent;
    if (goes_on) {
      steps_m.push_back((positions_m[i].second - positions_m[i - 1].second).norm());
    } else if (!steps_m.empty()) {
      longest_m = std::max(longest_m, static_cast<double>(steps_m.size()) * MedianOf(steps_m));
      steps_m.clear();
    }
  }
  return longest_m;
}

}  // namespace

std::vector<FarNode> FindFarNodes(const std::vector<std::pair<NodeKey, Eigen::Vector3d>>& positions_m) {
  if (positions_m.empty()) return {};
  const Eigen::Vector3d median_m = MedianPosition(positions_m);
  const double limit_m = std::max(kFar_m, kFarTrajectories * LongestTrajectory(positions_m));
  std::vector<FarNode> far;
  for (const auto& [node, position_m] : positions_m) {
    const double distance_m = (position_m - median_m).norm();
    if (distance_m > limit_m) far.push_back({node, distance_m});
  }
  if (2 * far.size() >= positions_m.size()) return {};
  std::stable_sort(far.begin(), far.end(),
                   [](const FarNode& a, const FarNode& b) { return a.distance_m > b.distance_m; });
  return far;
}

void AddFarNodes(const std::vector<FarNode>& far, google::protobuf::RepeatedPtrField<proto::FarNode>& nodes) {
  for (std::size_t i = 0; i < std::min(far.size(), kFarNodesShown); ++i) {
    proto::FarNode& node = *nodes.Add();
    *node.mutable_node() = ToProto(far[i].node);
    node.set_distance_m(far[i].distance_m);
  }
}

}  // namespace moondb
