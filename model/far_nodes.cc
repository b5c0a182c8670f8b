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
  Eigen::Vector3d median_m;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> coordinates;
    for (const auto& [node, position_m] : positions_m) coordinates.push_back(position_m[axis]);
    median_m[axis] = MedianOf(std::move(coordinates));
  }
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
