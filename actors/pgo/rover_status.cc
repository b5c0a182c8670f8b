#include "actors/pgo/rover_status.h"

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "model/odometry_scale.h"

namespace moondb {

namespace {

// A rover is anchored by three ranges, or by two loop closures. With fewer ranges it has more than one possible place,
// and a single loop closure may be wrong.
constexpr std::size_t kPointsMin = 6;
constexpr std::size_t kPointsOfRange = 2;
constexpr std::size_t kPointsOfClosure = 3;

// Adds rovers to `anchored` and returns the result. Repeatedly adds each rover whose accepted ranges and loop closures
// to agents in the set have at least kPointsMin points, until no more rovers can be added.
std::set<AgentId> FindAnchored(const std::vector<FactorVerdict>& verdicts, std::set<AgentId> anchored) {
  for (bool has_grown = true; has_grown;) {
    has_grown = false;
    std::map<AgentId, std::size_t> points;
    for (const FactorVerdict& verdict : verdicts) {
      const AgentId from = verdict.factor.from.agent;
      const AgentId to = verdict.factor.to.agent;
      if (!verdict.is_inlier || anchored.contains(from) == anchored.contains(to)) continue;
      points[anchored.contains(from) ? to : from] +=
          verdict.factor.kind == FactorKind::kRange ? kPointsOfRange : kPointsOfClosure;
    }
    for (const auto& [agent, count] : points) {
      if (count >= kPointsMin) has_grown |= anchored.insert(agent).second;
    }
  }
  return anchored;
}

// Returns the rovers whose accepted priors determine their place and heading: one prior with a yaw, or two positions
// more than kApart_m apart.
std::set<AgentId> FindAnchoredByPriors(const CheckedGraph& graph, const std::vector<FactorVerdict>& verdicts) {
  std::set<AgentId> anchored;
  std::map<AgentId, Eigen::Vector3d> first_m;
  for (std::size_t i = 0; i < graph.priors.size(); ++i) {
    if (!verdicts[graph.first_prior() + i].is_inlier) continue;
    const NodePrior& prior = *graph.priors[i].prior;
    const Eigen::Vector3d& position_m = prior.map_from_node.position_m;
    const auto [first, is_first] = first_m.try_emplace(prior.node.agent, position_m);
    const bool is_apart = !is_first && (position_m - first->second).head<2>().norm() > kApart_m;
    if (prior.extent != PriorExtent::kPosition || is_apart) anchored.insert(prior.node.agent);
  }
  return anchored;
}

// Numbers of one rover's accepted and rejected factors. A loop closure within the rover counts once.
struct FactorCounts {
  FactorCount ranges;
  FactorCount closures;
  FactorCount priors;
  std::size_t closures_to_others = 0;  // Accepted loop closures to other rovers.

  FactorCount& Of(FactorKind kind) {
    if (kind == FactorKind::kRange) return ranges;
    return kind == FactorKind::kLoopClosure ? closures : priors;
  }
};

std::map<AgentId, FactorCounts> CountFactors(const std::vector<FactorVerdict>& verdicts) {
  std::map<AgentId, FactorCounts> counts;
  for (const FactorVerdict& verdict : verdicts) {
    for (const AgentId agent : std::set<AgentId>{verdict.factor.from.agent, verdict.factor.to.agent}) {
      FactorCount& of_kind = counts[agent].Of(verdict.factor.kind);
      ++of_kind.usable;
      of_kind.rejected += !verdict.is_inlier;
      const bool is_to_other =
          verdict.factor.kind == FactorKind::kLoopClosure && verdict.factor.from.agent != verdict.factor.to.agent;
      counts[agent].closures_to_others += is_to_other && verdict.is_inlier;
    }
  }
  return counts;
}

// Describes where the rover's place comes from if no start is configured.
std::string WhereElse(const RoverResult& rover, const FactorCounts& counts) {
  const bool has_poses = counts.closures_to_others + counts.priors.accepted() > 0;
  const std::string what = rover.range_count == 0 ? "measurements" : has_poses ? "ranges and measurements" : "ranges";
  if (rover.anchoring != Anchoring::kUnanchored) return ": its " + what + " determine where it is";
  if (rover.range_count == 0 && !has_poses) return ": it starts at the pose of its first node";
  return ": its " + what + " determine only its pose relative to other rovers";
}

// Adds a line if more than a third of the factors of one kind are rejected.
void ReportIfContradicted(const FactorCount& counts, const std::string& what, const std::string& question,
                          const std::function<void(const std::string&)>& say) {
  if (3 * counts.rejected <= counts.usable) return;
  say(std::to_string(counts.rejected) + " of its " + std::to_string(counts.usable) + " " + what +
      " contradict the rest" + question);
}

std::string TextOf(const CheckedGraph& graph, const RoverResult& rover, const StartPrior& start,
                   const FactorCounts& counts, const std::string& why_not_placed, std::size_t part_count) {
  std::string text;
  const auto say = [&text](const std::string& line) { text += (text.empty() ? "" : "; ") + line; };
  if (!start.is_configured) say("no start pose configured for its first node" + WhereElse(rover, counts));
  if (!why_not_placed.empty() && rover.anchoring == Anchoring::kUnanchored) say("not placed: " + why_not_placed);
  if (rover.anchoring == Anchoring::kNoRanges) {
    const std::string which = rover.range_count > 0 ? "no accepted range to a rover in the map" : "no accepted range";
    say(which + ": only its start pose and odometry determine its poses");
  }
  if (rover.anchoring == Anchoring::kUnanchored) {
    say("no measurement places it in the map: give it a start in the team file, or two GNSS priors a few metres apart");
  }
  if (rover.anchoring == Anchoring::kYawFree) {
    say("no measurement determines its rotation about the base station: give one rover a start in the team file, or "
        "two GNSS priors a few metres apart");
  }
  if (rover.anchoring == Anchoring::kAmbiguous) {
    say("ambiguous: its measurements fit another place nearly as well: give it a start in the team file, "
        "or two GNSS priors");
  }
  ReportIfContradicted(counts.ranges, "ranges", ": check its start, those of other rovers, and the radios", say);
  ReportIfContradicted(counts.closures, "loop closures", "", say);
  ReportIfContradicted(counts.priors, "priors", ": check that they are in the frame map", say);
  if (!IsPlausibleOdometryScale(rover.odometry_scale)) {
    say("its odometry scale is implausible: check that all its edges are odometry, in metres");
  }
  if (part_count > 1) say("its odometry is interrupted in " + std::to_string(part_count - 1) + " places");
  if (const auto found = graph.left_out.find(rover.agent); found != graph.left_out.end()) {
    say(std::to_string(found->second.count) + " records excluded, first: " + found->second.first);
  }
  return text;
}

struct RoversInMap {
  std::set<AgentId> anchored;
  std::set<AgentId> yaw_free;
  // Number of accepted priors, and of accepted ranges and loop closures to other agents that are in the map.
  std::map<AgentId, std::size_t> ties;
};

RoversInMap FindInMap(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                      const std::vector<StartPrior>& starts, const std::vector<FactorVerdict>& verdicts) {
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
  configured.merge(FindAnchoredByPriors(graph, verdicts));
  result.anchored = FindAnchored(verdicts, configured);
  result.yaw_free = FindAnchored(verdicts, fixed);
  const auto is_in_map = [&](AgentId agent) { return fixed.contains(agent) || result.anchored.contains(agent); };
  for (const FactorVerdict& verdict : verdicts) {
    if (!verdict.is_inlier) continue;
    const AgentId from = verdict.factor.from.agent;
    const AgentId to = verdict.factor.to.agent;
    if (from == to && verdict.factor.kind != FactorKind::kPrior) continue;
    result.ties[from] += is_in_map(to) || from == to;
    result.ties[to] += is_in_map(from) || from == to;
  }
  return result;
}

}  // namespace

std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<FactorVerdict>& verdicts,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous,
                                     const std::map<AgentId, std::string>& not_placed) {
  std::map<AgentId, FactorCounts> counts = CountFactors(verdicts);
  RoversInMap in_map = FindInMap(graph, rovers, starts, verdicts);
  std::vector<RoverResult> results;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    RoverResult result;
    result.agent = rovers[i].agent;
    const FactorCounts& of_rover = counts[result.agent];
    result.odometry_scale = 1 + scales[i];
    result.node_count = rovers[i].count;
    result.range_count = of_rover.ranges.accepted();
    result.rejected_range_count = of_rover.ranges.rejected;
    if (in_map.anchored.contains(result.agent)) {
      result.anchoring = in_map.ties[result.agent] > 0 ? Anchoring::kAnchored : Anchoring::kNoRanges;
      if (ambiguous.contains(result.agent)) result.anchoring = Anchoring::kAmbiguous;
    } else if (in_map.yaw_free.contains(result.agent)) {
      result.anchoring = Anchoring::kYawFree;
    }
    const auto why = not_placed.find(result.agent);
    result.text = TextOf(graph, result, starts[i], of_rover, why == not_placed.end() ? "" : why->second,
                         rovers[i].part_heads.size());
    results.push_back(std::move(result));
  }
  return results;
}

std::set<AgentId> FindUnplaced(const std::vector<RoverResult>& rovers) {
  const bool has_placed = std::any_of(rovers.begin(), rovers.end(), [](const RoverResult& rover) {
    return rover.anchoring == Anchoring::kAnchored || rover.anchoring == Anchoring::kNoRanges;
  });
  std::set<AgentId> unplaced;
  for (const RoverResult& rover : rovers) {
    const bool is_alone = rover.anchoring == Anchoring::kUnanchored || rover.anchoring == Anchoring::kAmbiguous;
    if (is_alone || (rover.anchoring == Anchoring::kYawFree && has_placed)) unplaced.insert(rover.agent);
  }
  return unplaced;
}

}  // namespace moondb
