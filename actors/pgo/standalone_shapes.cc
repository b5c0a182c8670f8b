#include "actors/pgo/standalone_shapes.h"

#include <algorithm>
#include <map>
#include <set>

#include "actors/pgo/connected_parts.h"
#include "model/metrics.h"

namespace moondb {

namespace {

constexpr double kSameShapePart = 0.01;  // Tolerance of positions, as a fraction of the part's extent.
constexpr double kRounding_m = 1e-6;

using Places = std::map<NodeKey, Pose>;

bool IsSameShape(const Places& a, const Places& b, bool is_planar) {
  const Pose b_from_a = FindAlignment(a, b, is_planar);
  const Eigen::Vector3d& first_m = b.begin()->second.position_m;
  double extent_m = 0;
  double error_m = 0;
  for (const auto& [key, place] : b) {
    extent_m = std::max(extent_m, (place.position_m - first_m).norm());
    error_m = std::max(error_m, (b_from_a * a.at(key).position_m - place.position_m).norm());
  }
  return a.size() == 1 || error_m <= kSameShapePart * extent_m + kRounding_m;
}

}  // namespace

std::vector<std::size_t> FindJoined(const StandaloneGraph& graph) {
  ConnectedParts parts(graph.nodes.size());
  for (const PlainStep& step : graph.steps) parts.Join(step.from, step.to);
  for (const PlainSighting& sighting : graph.sightings) parts.Join(sighting.from, sighting.to);
  for (const PlainRange& range : graph.ranges) parts.Join(range.from, range.to);
  std::vector<std::size_t> joined;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) joined.push_back(parts.HeadOf(node));
  return joined;
}

std::size_t CountLooseParts(const StandaloneGraph& graph, const std::vector<std::size_t>& joined) {
  std::set<std::size_t> parts(joined.begin(), joined.end());
  std::set<std::size_t> fixed;
  for (std::size_t node = 0; node < joined.size(); ++node) {
    if (graph.nodes[node].is_fixed) fixed.insert(joined[node]);
  }
  return parts.size() - fixed.size() + (fixed.empty() ? 0 : 1);
}

bool HaveSameShape(const StandaloneGraph& graph, const std::vector<std::size_t>& joined, const PlainState& a,
                   const PlainState& b) {
  std::map<std::size_t, std::pair<Places, Places>> parts;
  for (std::size_t node = 0; node < joined.size(); ++node) {
    auto& [in_a, in_b] = parts[joined[node]];
    in_a[graph.nodes[node].key] = FromBlock(a[node]);
    in_b[graph.nodes[node].key] = FromBlock(b[node]);
  }
  return std::all_of(parts.begin(), parts.end(), [&graph](const auto& part) {
    return IsSameShape(part.second.first, part.second.second, graph.is_planar);
  });
}

}  // namespace moondb
