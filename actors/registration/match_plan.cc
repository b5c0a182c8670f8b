#include "actors/registration/match_plan.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace moondb {
namespace {

constexpr int kAttemptsMax = 2;

}  // namespace

bool MatchPlan::IsDue(const Attempts& attempts, const PlanarOffset& expected) const {
  if (attempts.count >= kAttemptsMax) return false;
  if (!attempts.is_accepted) return true;
  const PlanarOffset moved = PlanarOffset::From(attempts.expected.ToPose().Inverse() * expected.ToPose());
  return std::hypot(moved.x_m, moved.y_m) > options_.narrow.side_m / 2 ||
         std::abs(moved.yaw_rad) > options_.narrow.yaw_rad / 2;
}

std::vector<PlannedMatch> MatchPlan::StartPass(const std::vector<RegisteredMap>& maps,
                                               const std::function<bool(AgentId, AgentId)>& are_joined) const {
  std::vector<PlannedMatch> planned;
  std::set<std::pair<NodeKey, NodeKey>> nodes;
  for (const MatchCandidate& candidate : FindCandidates(maps, options_.candidates, are_joined)) {
    if (planned.size() >= options_.pairs_max) break;
    const RegisteredMap& first = maps[candidate.first];
    const RegisteredMap& second = maps[candidate.second];
    const PlanarOffset expected = PlanarOffset::Between(first.map_from_local, second.map_from_local);
    const auto attempts = attempts_.find({first.key, second.key});
    if (attempts != attempts_.end() && !IsDue(attempts->second, expected)) continue;
    if (first.node == second.node || !nodes.emplace(first.node, second.node).second) continue;
    planned.push_back({first, second, expected, attempts == attempts_.end() ? options_.wide : options_.narrow});
  }
  std::ranges::sort(planned, [](const PlannedMatch& a, const PlannedMatch& b) {
    return std::tie(a.first.key, a.second.key) < std::tie(b.first.key, b.second.key);
  });
  return planned;
}

void MatchPlan::Note(const PlannedMatch& planned, const MatchResult& result) {
  Attempts& attempts = attempts_[{planned.first.key, planned.second.key}];
  ++attempts.count;
  attempts.is_accepted = result.verdict == MatchVerdict::kAccepted;
  attempts.expected = planned.expected;
}

}  // namespace moondb
