#include "actors/pgo/outlier_tests.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace moondb {

namespace {

// Hysteresis: a rejected factor is accepted again only if its residual is below this fraction of the limit for
// rejection. Otherwise verdicts could alternate between tests.
constexpr double kReturnPart = 0.9;
// For a new factor, the limit for rejection is multiplied by this number, because the initial values of a new node come
// only from odometry.
constexpr double kNewFactorSlack = 2;
constexpr double kMisfitShareMax = 0.4;
constexpr double kRejectedShareMax = 0.5;
constexpr double kJudgedRangesMin = 4;  // Fewer ranges are not enough to judge a rover.
// Two consecutive ranges of a pair of agents belong to one burst only if their time difference is at most this many
// times the pair's median interval.
constexpr double kBurstIntervals = 3;

// Returns the residual above which a tested factor is rejected, in sigmas.
double LimitOf(const CheckedGraph& graph, std::size_t factor, const SolverOptions& options) {
  return factor < graph.first_closure() ? options.reject_sigmas : options.reject_distance;
}

struct Share {
  double part = 0;
  double whole = 0;

  void Add(bool is_part) {
    part += is_part;
    ++whole;
  }

  bool IsMoreThan(double share) const { return part > share * whole; }
};

// Returns the ranges of each pair of agents, in order of time.
std::vector<std::vector<std::size_t>> FindSeries(const CheckedGraph& graph) {
  std::map<std::pair<AgentId, AgentId>, std::vector<std::size_t>> series;
  for (std::size_t i = 0; i < graph.ranges.size(); ++i) {
    const RangeEdge& edge = *graph.ranges[i].edge;
    series[std::minmax(edge.from.agent, edge.to.agent)].push_back(i);
  }
  std::vector<std::vector<std::size_t>> result;
  for (auto& [pair, ranges] : series) {
    std::stable_sort(ranges.begin(), ranges.end(), [&graph](std::size_t a, std::size_t b) {
      return graph.ranges[a].edge->timestamp_ns < graph.ranges[b].edge->timestamp_ns;
    });
    result.push_back(std::move(ranges));
  }
  return result;
}

// Also rejects a range next to a rejected range of the same pair, if both residuals have the same sign and the range's
// residual exceeds its limit in `limits`. An obstacle makes several consecutive ranges too long.
void ExtendBursts(const CheckedGraph& graph, const std::vector<std::size_t>& series,
                  const std::vector<double>& residuals, const std::vector<double>& limits,
                  std::vector<bool>& is_inlier) {
  const auto timestamp_of = [&graph](std::size_t range) {
    return static_cast<double>(graph.ranges[range].edge->timestamp_ns);
  };
  std::vector<double> intervals;
  for (std::size_t i = 1; i < series.size(); ++i)
    intervals.push_back(timestamp_of(series[i]) - timestamp_of(series[i - 1]));
  std::sort(intervals.begin(), intervals.end());
  const double apart_max = intervals.empty() ? 0 : kBurstIntervals * intervals[intervals.size() / 2];
  const auto extend = [&](std::size_t from, std::size_t to) {
    const bool is_same_way = residuals[from] * residuals[to] > 0;
    const bool is_near = std::abs(timestamp_of(from) - timestamp_of(to)) <= apart_max;
    if (!is_inlier[from] && is_near && is_same_way && std::abs(residuals[to]) > limits[to]) is_inlier[to] = false;
  };
  for (std::size_t i = 1; i < series.size(); ++i) extend(series[i - 1], series[i]);
  for (std::size_t i = series.size(); i-- > 1;) extend(series[i], series[i - 1]);
}

}  // namespace

std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const std::vector<bool>& is_allowed,
                              const SolverOptions& options) {
  std::vector<bool> is_inlier(residuals.size());
  std::vector<double> burst_limits(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double part = before[i] ? 1 : kReturnPart;
    is_inlier[i] = terms.HasTested(i) ? std::abs(residuals[i]) <= part * LimitOf(graph, i, options) : before[i];
    if (!is_allowed[i]) is_inlier[i] = false;
    burst_limits[i] = part * options.burst_sigmas;
  }
  for (const std::vector<std::size_t>& series : FindSeries(graph)) {
    ExtendBursts(graph, series, residuals, burst_limits, is_inlier);
  }
  return is_inlier;
}

bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier) {
  std::map<AgentId, Share> rejected;
  for (std::size_t i = 0; i < graph.first_closure(); ++i) {
    rejected[graph.ranges[i].edge->from.agent].Add(!is_inlier[i]);
    rejected[graph.ranges[i].edge->to.agent].Add(!is_inlier[i]);
  }
  return std::any_of(rejected.begin(), rejected.end(), [](const auto& agent) {
    return agent.second.whole >= kJudgedRangesMin && agent.second.IsMoreThan(kRejectedShareMax);
  });
}

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options) {
  FirstVerdicts verdicts;
  std::map<AgentId, Share> misfits;  // Share of misfits among the ranges of each agent's new nodes.
  const auto add = [&verdicts](bool is_old, bool was_inlier, bool fits) {
    verdicts.is_inlier.push_back(is_old ? was_inlier : fits);
    verdicts.is_inlier_before.push_back(was_inlier);
    verdicts.is_trusted.push_back(is_old && was_inlier);
  };
  for (std::size_t i = 0; i < graph.first_closure(); ++i) {
    const CheckedRange& range = graph.ranges[i];
    const bool is_from_known = IsKnown(graph, initial, range.from);
    const bool is_to_known = IsKnown(graph, initial, range.to);
    const bool is_old = is_from_known && is_to_known;
    const bool fits = std::abs(residuals[i]) <= kNewFactorSlack * options.reject_sigmas;
    add(is_old, !is_old || !last.rejected.contains(graph.KeyOfTested(i)), fits);
    if (!is_from_known) misfits[range.edge->from.agent].Add(!fits);
    if (!is_to_known) misfits[range.edge->to.agent].Add(!fits);
  }
  bool has_misfit = false;
  for (std::size_t i = graph.first_closure(); i < residuals.size(); ++i) {
    const FactorKey key = graph.KeyOfTested(i);
    const bool was_accepted = last.accepted.contains(key);
    const bool is_old = was_accepted || last.rejected.contains(key);
    const bool fits = residuals[i] <= kNewFactorSlack * options.reject_distance;
    add(is_old, was_accepted || !is_old, fits);
    has_misfit = has_misfit || (!is_old && !fits);
  }
  verdicts.is_doubtful = has_misfit ||
                         std::any_of(misfits.begin(), misfits.end(),
                                     [](const auto& agent) { return agent.second.IsMoreThan(kMisfitShareMax); }) ||
                         HasMostlyRejected(graph, verdicts.is_inlier);
  return verdicts;
}

}  // namespace moondb
