#include "actors/registration/place_check.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

constexpr std::size_t kTriedMin = 10;      // Pairs of maps.
constexpr std::size_t kAcceptedPart = 10;  // At least one of so many pairs matches if both places are right.
constexpr double kContradicted = 0.14;
constexpr double kOwnFactor = 2;

// Standard deviations of a start.
constexpr double kStartSigma_m = 0.05;
constexpr double kStartSigma_rad = 0.01;

}  // namespace

bool PlaceCheck::IsDoubtful(const MatchPlan::Counts& counts) {
  const std::size_t tried = std::accumulate(counts.begin(), counts.end(), std::size_t{0},
                                            [](std::size_t sum, const auto& one) { return sum + one.second; });
  const auto accepted = counts.find(MatchVerdict::kAccepted);
  return tried >= kTriedMin && (accepted == counts.end() || kAcceptedPart * accepted->second < tried);
}

void PlaceCheck::Begin(std::vector<AgentPair> pairs, std::set<AgentId> placed) {
  pairs_ = std::move(pairs);
  placed_ = std::move(placed);
  comparison_.reset();
  fits_.clear();
}

std::optional<PlaceCheck::Comparison> PlaceCheck::Compare(const AgentPair& agents, const std::set<AgentId>& placed,
                                                          const KnownMaps& maps) {
  const std::vector<RegisteredMap> all = maps.FindRegistered();
  std::optional<SearchedRover> first = SearchedRover::Find(agents.first, all, maps, placed);
  std::optional<SearchedRover> second = SearchedRover::Find(agents.second, all, maps, placed);
  if (!first || !second || first->windows().empty() || second->windows().empty()) return std::nullopt;
  Comparison comparison{{*std::move(first), *std::move(second)}, SubmapGraph(), {}, {}, {}, {}};
  std::vector<PlanarOffset> poses = {PlanarOffset()};  // The frame `map`.
  for (const SearchedRover& rover : comparison.rovers) {
    for (std::size_t i = 0; i < rover.windows().size(); ++i) poses.push_back(rover.SolvedPose(i));
  }
  const std::size_t second_pose = comparison.second_pose();
  comparison.graph = SubmapGraph(poses);
  AddOdometry(comparison.rovers[0].submaps(), 1, comparison.graph);
  AddOdometry(comparison.rovers[1].submaps(), second_pose, comparison.graph);
  // The oldest windows are the last ones.
  const Eigen::Matrix3d start = Eigen::Vector3d(kStartSigma_m, kStartSigma_m, kStartSigma_rad).cwiseAbs2().asDiagonal();
  for (const std::size_t oldest : {second_pose - 1, poses.size() - 1})
    comparison.graph.Add({0, oldest, poses[oldest], start});
  comparison.graph.Solve();
  comparison.submaps.resize(poses.size());
  for (std::size_t i = 1; i < poses.size(); ++i) {
    for (std::size_t j = i + 1; j < poses.size(); ++j) {
      // Windows of one rover with another between them share no map.
      const bool is_own = (i < second_pose) == (j < second_pose);
      if (!is_own || j == i + 2) comparison.left.emplace_back(i, j);
    }
  }
  return comparison;
}

std::shared_ptr<const Submap> PlaceCheck::Comparison::Fuse(std::size_t pose, const KnownMaps& maps) const {
  return pose < second_pose() ? rovers[0].Fuse(pose - 1, maps) : rovers[1].Fuse(pose - second_pose(), maps);
}

void PlaceCheck::Step(const KnownMaps& maps) {
  Check(!pairs_.empty(), "a pair of rovers is left");
  if (!comparison_) {
    comparison_ = Compare(pairs_.back(), placed_, maps);
    if (!comparison_) pairs_.pop_back();
    return;
  }
  Comparison& now = *comparison_;
  while (!now.left.empty()) {
    const auto [i, j] = now.left.back();
    if (SetFit::MayOverlap(now.graph, i, j)) {
      for (const std::size_t pose : {i, j}) {
        if (now.submaps[pose]) continue;
        now.submaps[pose] = now.Fuse(pose, maps);
        return;
      }
      SetFit& fit = j < now.second_pose() ? now.own[0] : i >= now.second_pose() ? now.own[1] : now.fit;
      fit.Add(now.graph, i, j, *now.submaps[i], *now.submaps[j]);
      now.left.pop_back();
      return;
    }
    now.left.pop_back();
  }
  Finish();
}

void PlaceCheck::Finish() {
  const Comparison& done = *comparison_;
  PlaceFit& fit = fits_[pairs_.back()];
  fit.matched = done.fit.matched();
  fit.contradicted = done.fit.contradicted();
  fit.own_contradicted = std::max(done.own[0].contradicted(), done.own[1].contradicted());
  const bool has_own = done.own[0].has_common() && done.own[1].has_common();
  fit.is_contradicted =
      has_own && fit.contradicted >= kContradicted && fit.contradicted >= kOwnFactor * fit.own_contradicted;
  comparison_.reset();
  pairs_.pop_back();
}

}  // namespace moondb
