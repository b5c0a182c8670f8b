#include "actors/pgo/rover_status.h"

#include <map>
#include <string>
#include <utility>

#include "model/odometry_scale.h"

namespace moondb {

namespace {

constexpr std::size_t kAnchoringRangesMin = 3;  // With fewer ranges, a rover has more than one possible place.

// Adds rovers to `anchored` and returns the result. Repeatedly adds each rover with at least kAnchoringRangesMin
// accepted ranges to agents in the set, until no more rovers can be added.
std::set<AgentId> FindAnchored(const std::vector<RangeVerdict>& ranges, std::set<AgentId> anchored) {
  for (bool has_grown = true; has_grown;) {
    has_grown = false;
    std::map<AgentId, std::size_t> ranges_to_anchored;
    for (const RangeVerdict& range : ranges) {
      if (!range.is_inlier || anchored.contains(range.from.agent) == anchored.contains(range.to.agent)) continue;
      const AgentId agent = anchored.contains(range.from.agent) ? range.to.agent : range.from.agent;
      ++ranges_to_anchored[agent];
    }
    for (const auto& [agent, count] : ranges_to_anchored) {
      if (count >= kAnchoringRangesMin) has_grown |= anchored.insert(agent).second;
    }
  }
  return anchored;
}

// Describes where the rover's place comes from if no start is configured.
std::string WhereElse(const RoverResult& rover) {
  if (rover.anchoring != Anchoring::kUnanchored) return ": its ranges say where it is";
  return rover.range_count > 0 ? ": its ranges say how it stands to other rovers" : ": begins at its raw pose";
}

std::string TextOf(const CheckedGraph& graph, const RoverResult& rover, const StartPrior& start,
                   std::size_t part_count) {
  std::string text;
  const auto say = [&text](const std::string& line) { text += (text.empty() ? "" : "; ") + line; };
  if (!start.is_configured) say("no start pose configured for its first node" + WhereElse(rover));
  if (rover.anchoring == Anchoring::kNoRanges) {
    const std::string which = rover.range_count > 0 ? "no accepted range to a rover in the map" : "no accepted range";
    say(which + ": start pose and odometry alone");
  }
  if (rover.anchoring == Anchoring::kUnanchored) say("nothing ties it to the map");
  if (rover.anchoring == Anchoring::kYawFree) say("nothing says how it is turned about the base station");
  if (rover.anchoring == Anchoring::kAmbiguous) say("ambiguous: it would stand nearly as well elsewhere");
  if (3 * rover.rejected_range_count > rover.range_count + rover.rejected_range_count) {
    say(std::to_string(rover.rejected_range_count) + " of its " +
        std::to_string(rover.range_count + rover.rejected_range_count) +
        " ranges contradict the rest: is its start right, or another rover's, are the radios?");
  }
  if (!IsPlausibleOdometryScale(rover.odometry_scale)) {
    say("its odometry scale is implausible: are all its edges odometry, in metres?");
  }
  if (part_count > 1) say("its odometry is interrupted in " + std::to_string(part_count - 1) + " places");
  if (const auto found = graph.left_out.find(rover.agent); found != graph.left_out.end()) {
    say(std::to_string(found->second.count) + " records left out, first: " + found->second.first);
  }
  return text;
}

struct RoversInMap {
  std::set<AgentId> anchored;
  std::set<AgentId> yaw_free;
  std::map<AgentId, std::size_t> ranges_in_map;  // Number of accepted ranges to agents that are in the map.
};

RoversInMap FindInMap(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                      const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges) {
  std::set<AgentId> fixed;
  std::set<AgentId> configured;
  for (const CheckedNode& node : graph.nodes) {
    if (node.is_fixed) fixed.insert(node.key.agent);
  }
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (starts[i].is_configured) configured.insert(rovers[i].agent);
  }
  RoversInMap result;
  if (FixedNodesHoldYaw(graph)) configured.insert(fixed.begin(), fixed.end());
  result.anchored = FindAnchored(ranges, configured);
  result.yaw_free = FindAnchored(ranges, fixed);
  for (const RangeVerdict& range : ranges) {
    const auto is_in_map = [&](AgentId agent) { return fixed.contains(agent) || result.anchored.contains(agent); };
    if (!range.is_inlier) continue;
    result.ranges_in_map[range.from.agent] += is_in_map(range.to.agent);
    result.ranges_in_map[range.to.agent] += is_in_map(range.from.agent);
  }
  return result;
}

}  // namespace

std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous) {
  std::map<AgentId, std::size_t> accepted;
  std::map<AgentId, std::size_t> rejected;
  for (const RangeVerdict& range : ranges) {
    std::map<AgentId, std::size_t>& counts = range.is_inlier ? accepted : rejected;
    ++counts[range.from.agent];
    ++counts[range.to.agent];
  }
  RoversInMap in_map = FindInMap(graph, rovers, starts, ranges);
  std::vector<RoverResult> results;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    RoverResult result;
    result.agent = rovers[i].agent;
    result.odometry_scale = 1 + scales[i];
    result.node_count = rovers[i].count;
    result.range_count = accepted[result.agent];
    result.rejected_range_count = rejected[result.agent];
    if (in_map.anchored.contains(result.agent)) {
      result.anchoring = in_map.ranges_in_map[result.agent] > 0 ? Anchoring::kAnchored : Anchoring::kNoRanges;
      if (ambiguous.contains(result.agent)) result.anchoring = Anchoring::kAmbiguous;
    } else if (in_map.yaw_free.contains(result.agent)) {
      result.anchoring = Anchoring::kYawFree;
    }
    result.text = TextOf(graph, result, starts[i], rovers[i].part_heads.size());
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace moondb
