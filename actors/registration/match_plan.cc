#include "actors/registration/match_plan.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "model/origin_quota.h"

namespace moondb {
namespace {

constexpr int kAttemptsMax = 2;

MatchPlan::AgentPair AgentsOf(const PlannedMatch& planned) {
  return std::minmax(AgentId{planned.first.node.agent}, AgentId{planned.second.node.agent});
}

}  // namespace

bool MatchPlan::IsDue(const Attempts& attempts, const PlanarOffset& expected) const {
  if (attempts.count >= kAttemptsMax) return false;
  if (attempts.verdict != MatchVerdict::kAccepted) return true;
  const PlanarOffset moved = attempts.expected.Inverse() * expected;
  return std::hypot(moved.x_m, moved.y_m) > options_.narrow.side_m / 2 ||
         std::abs(moved.yaw_rad) > options_.narrow.yaw_rad / 2;
}

std::vector<PlannedMatch> MatchPlan::StartPass(const std::vector<RegisteredMap>& maps,
                                               const std::function<bool(AgentId, AgentId)>& are_joined) {
  std::map<AgentPair, std::vector<PlannedMatch>> of_agents;
  std::set<std::pair<NodeKey, NodeKey>> nodes;
  for (const MatchCandidate& candidate : FindCandidates(maps, options_.candidates, are_joined)) {
    const RegisteredMap& first = maps[candidate.first];
    const RegisteredMap& second = maps[candidate.second];
    const PlanarOffset expected = PlanarOffset::Between(first.map_from_local, second.map_from_local);
    const auto attempts = attempts_.find({first.key, second.key});
    if (attempts != attempts_.end() && !IsDue(attempts->second, expected)) continue;
    if (first.node == second.node || !nodes.emplace(first.node, second.node).second) continue;
    const PlannedMatch match{first, second, expected, attempts == attempts_.end() ? options_.wide : options_.narrow};
    of_agents[AgentsOf(match)].push_back(match);
  }
  std::vector<std::uint64_t> counts;
  for (const auto& [agents, matches] : of_agents) counts.push_back(matches.size());
  const std::size_t level = FairLevel(std::move(counts), options_.pairs_max);
  shares_.clear();
  std::vector<PlannedMatch> planned;
  for (const auto& [agents, matches] : of_agents) {
    const std::size_t count = std::min(matches.size(), level);
    planned.insert(planned.end(), matches.begin(), matches.begin() + static_cast<std::ptrdiff_t>(count));
    shares_[agents] = {count * options_.pair_work_max, matches.size() - count};
  }
  std::ranges::sort(planned, [](const PlannedMatch& a, const PlannedMatch& b) {
    return std::tie(a.first.key, a.second.key) < std::tie(b.first.key, b.second.key);
  });
  return planned;
}

bool MatchPlan::HasWorkFor(const PlannedMatch& planned) {
  Share& share = shares_[AgentsOf(planned)];
  if (share.work_left > 0) return true;
  ++share.left_out_count;
  return false;
}

std::map<MatchPlan::AgentPair, std::size_t> MatchPlan::CountLeftOut() const {
  std::map<AgentPair, std::size_t> counts;
  for (const auto& [agents, share] : shares_) {
    if (share.left_out_count > 0) counts[agents] = share.left_out_count;
  }
  return counts;
}

void MatchPlan::Clear() {
  attempts_.clear();
  shares_.clear();
  results_.clear();
}

void MatchPlan::Note(const PlannedMatch& planned, const MatchResult& result) {
  Share& share = shares_[AgentsOf(planned)];
  share.work_left -= std::min(share.work_left, result.work);
  Attempts& attempts = attempts_[{planned.first.key, planned.second.key}];
  Counts& counts = results_[AgentsOf(planned)];
  if (attempts.count > 0) --counts[attempts.verdict];
  ++counts[result.verdict];
  ++attempts.count;
  attempts.verdict = result.verdict;
  attempts.expected = planned.expected;
}

}  // namespace moondb
