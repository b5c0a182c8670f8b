#include "actors/registration/submap_sets.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "actors/registration/submap_graph.h"

namespace moondb {
namespace {

constexpr int kRounds = 3;
constexpr double kLeastVariance = 1e-8;

}  // namespace

SubmapNodes TrackSubmaps::NodesOf(std::size_t window) const {
  const SubmapWindow& of = windows[window];
  return {track->node(of.maps.front().index).index, track->node(of.middle).index,
          track->node(of.maps.back().index).index};
}

void AddOdometry(const TrackSubmaps& rover, std::size_t first_pose, SubmapGraph& graph) {
  for (std::size_t i = 1; i < rover.windows.size(); ++i) {
    const PlanarOffset from = rover.OdomFromSubmap(i - 1);
    const PlanarOffset to = rover.OdomFromSubmap(i);
    const Eigen::Matrix3d covariance =
        rover.track->CovarianceOf(rover.windows[i - 1].middle, rover.windows[i].middle, to.position_m()) +
        Eigen::Matrix3d(kLeastVariance * Eigen::Matrix3d::Identity());
    graph.Add({first_pose + i - 1, first_pose + i, from.Inverse() * to, TurnedCovariance(covariance, -from.yaw_rad)});
  }
}

SubmapSets::SubmapSets(TrackSubmaps first, TrackSubmaps second, std::vector<SubmapHypothesis> hypotheses)
    : first_(std::move(first)), second_(std::move(second)), hypotheses_(std::move(hypotheses)) {
  std::ranges::stable_sort(hypotheses_, std::greater(), [](const SubmapHypothesis& one) { return one.place.evidence; });
  if (hypotheses_.size() > kHypothesesMax) hypotheses_.resize(kHypothesesMax);
  agree_.assign(hypotheses_.size(), std::vector<bool>(hypotheses_.size()));
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    for (std::size_t j = i + 1; j < hypotheses_.size(); ++j)
      agree_[i][j] = agree_[j][i] = Agree(hypotheses_[i], hypotheses_[j]);
  }
  is_used_.resize(hypotheses_.size());
}

// Compares where both place the second submap of `b`, in the odometry frame of the first rover.
bool SubmapSets::Agree(const SubmapHypothesis& a, const SubmapHypothesis& b) const {
  const PlanarOffset a_first = first_.OdomFromSubmap(a.first);
  const PlanarOffset b_first = first_.OdomFromSubmap(b.first);
  const PlanarOffset frame_of_second = a_first * a.place.first_from_second * second_.OdomFromSubmap(a.second).Inverse();
  const PlanarOffset by_a = frame_of_second * second_.OdomFromSubmap(b.second);
  const PlanarOffset by_b = b_first * b.place.first_from_second;
  const Eigen::Vector2d apart_m = by_a.position_m() - by_b.position_m();
  const Eigen::Vector3d residual(apart_m.x(), apart_m.y(), WrappedAngle(by_a.yaw_rad - by_b.yaw_rad));
  const PlanarOffset a_second = a_first * a.place.first_from_second;
  Eigen::Matrix3d covariance = ShiftedCovariance(TurnedCovariance(a.place.covariance, a_first.yaw_rad),
                                                 by_a.position_m() - a_second.position_m());
  covariance += TurnedCovariance(b.place.covariance, b_first.yaw_rad);
  covariance +=
      first_.track->CovarianceOf(first_.windows[a.first].middle, first_.windows[b.first].middle, by_b.position_m());
  covariance +=
      TurnedCovariance(second_.track->CovarianceOf(second_.windows[a.second].middle, second_.windows[b.second].middle,
                                                   second_.OdomFromSubmap(b.second).position_m()),
                       frame_of_second.yaw_rad);
  return residual.dot(covariance.inverse() * residual) <= kPlanarChiSquareMax;
}

std::vector<std::size_t> SubmapSets::CliqueOf(std::size_t seed) const {
  std::vector<std::size_t> clique = {seed};
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    if (i == seed || is_used_[i]) continue;
    if (std::ranges::all_of(clique, [&](std::size_t member) { return agree_[i][member]; })) clique.push_back(i);
  }
  std::ranges::sort(clique);
  return clique;
}

double SubmapSets::EvidenceOf(const std::vector<std::size_t>& members) const {
  std::map<std::size_t, double> of_first, of_second;
  for (const std::size_t member : members) {
    const SubmapHypothesis& one = hypotheses_[member];
    double& first = of_first[one.first];
    double& second = of_second[one.second];
    first = std::max(first, one.place.evidence);
    second = std::max(second, one.place.evidence);
  }
  const auto sum = [](const std::map<std::size_t, double>& all) {
    return std::accumulate(all.begin(), all.end(), 0.0,
                           [](double so_far, const auto& one) { return so_far + one.second; });
  };
  return std::min(sum(of_first), sum(of_second));
}

SubmapSet SubmapSets::Solve(std::vector<std::size_t> members) const {
  const std::size_t first_count = first_.windows.size();
  const auto factor_of = [&](std::size_t index) {
    const SubmapHypothesis& one = hypotheses_[index];
    return SubmapGraph::Factor{one.first, first_count + one.second, one.place.first_from_second, one.place.covariance};
  };
  SubmapSet set;
  const SubmapHypothesis& best = hypotheses_[members.front()];
  const PlanarOffset frame_of_second =
      first_.OdomFromSubmap(best.first) * best.place.first_from_second * second_.OdomFromSubmap(best.second).Inverse();
  std::vector<PlanarOffset> poses;
  for (std::size_t i = 0; i < first_count; ++i) poses.push_back(first_.OdomFromSubmap(i));
  for (std::size_t i = 0; i < second_.windows.size(); ++i) poses.push_back(frame_of_second * second_.OdomFromSubmap(i));
  for (int round = 0; round < kRounds; ++round) {
    SubmapGraph graph(poses);
    AddOdometry(first_, 0, graph);
    AddOdometry(second_, first_count, graph);
    for (const std::size_t member : members) graph.Add(factor_of(member));
    graph.Solve();
    poses = graph.poses();
    std::vector<std::size_t> fitting;
    for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
      if (is_used_[i]) continue;
      const bool is_member = std::ranges::binary_search(members, i);
      if (graph.ChiSquareOf(factor_of(i), !is_member) <= kPlanarChiSquareMax) fitting.push_back(i);
    }
    set.sigma_m = 0;
    for (const std::size_t member : fitting) {
      const SubmapGraph::Factor factor = factor_of(member);
      set.sigma_m = std::max(set.sigma_m, WorstSigma_m(graph.RelativeCovarianceOf(factor.from, factor.to)));
    }
    set.graph = std::move(graph);
    if (fitting == members || fitting.empty()) break;
    members = std::move(fitting);
  }
  set.evidence = EvidenceOf(members);
  set.members = std::move(members);
  set.first_count = first_count;
  return set;
}

bool SubmapSets::FindNext() {
  if (sets_.size() == kSetsMax) return false;
  std::vector<std::pair<double, std::vector<std::size_t>>> cliques;
  std::set<std::vector<std::size_t>> known;
  for (std::size_t seed = 0; seed < hypotheses_.size(); ++seed) {
    if (is_used_[seed]) continue;
    std::vector<std::size_t> clique = CliqueOf(seed);
    if (!known.insert(clique).second) continue;
    const double evidence = EvidenceOf(clique);
    cliques.emplace_back(evidence, std::move(clique));
  }
  std::ranges::stable_sort(cliques, [](const auto& a, const auto& b) { return a.first > b.first; });
  if (cliques.empty()) return false;
  cliques.resize(std::min(cliques.size(), kSolvedMax));
  SubmapSet best;
  for (auto& [evidence, clique] : cliques) {
    SubmapSet solved = Solve(std::move(clique));
    if (solved.evidence > best.evidence) best = std::move(solved);
  }
  if (best.members.empty()) return false;
  for (const std::size_t member : best.members) is_used_[member] = true;
  sets_.push_back(std::move(best));
  return true;
}

}  // namespace moondb
