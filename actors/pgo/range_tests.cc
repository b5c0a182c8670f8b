#include "actors/pgo/range_tests.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace moondb {

namespace {

// A rejected range comes back a little later than it went, lest tests say one thing and the other in turn.
constexpr double kReturnPart = 0.9;
constexpr double kNewRangeSlack = 2;  // A new node's first guess is odometry's.

// The ranges of each pair of agents, in order of time.
std::vector<std::vector<std::size_t>> FindSeries(const CheckedGraph& graph) {
  std::map<std::pair<AgentId, AgentId>, std::vector<std::size_t>> series;
  for (std::size_t i = 0; i < graph.ranges.size(); ++i) {
    const RangeEdge& edge = *graph.ranges[i].edge;
    series[std::minmax(edge.from.agent, edge.to.agent)].push_back(i);
  }
  std::vector<std::vector<std::size_t>> result;
  for (auto& [pair, ranges] : series) {
    std::stable_sort(ranges.begin(), ranges.end(), [&graph](std::size_t a, std::size_t b) {
      return graph.ranges[a].edge->stamp_ns < graph.ranges[b].edge->stamp_ns;
    });
    result.push_back(std::move(ranges));
  }
  return result;
}

// What blocks a line of sight does so for a while: beside a rejected range of the same pair, one that errs the same way
// needs less to be doubted.
void ExtendBursts(const std::vector<std::size_t>& series, const std::vector<double>& residuals,
                  const std::vector<double>& limits, std::vector<bool>& is_inlier) {
  const auto extend = [&](std::size_t from, std::size_t to) {
    const bool is_same_way = residuals[from] * residuals[to] > 0;
    if (!is_inlier[from] && is_same_way && std::abs(residuals[to]) > limits[to]) is_inlier[to] = false;
  };
  for (std::size_t i = 1; i < series.size(); ++i) extend(series[i - 1], series[i]);
  for (std::size_t i = series.size(); i-- > 1;) extend(series[i], series[i - 1]);
}

}  // namespace

std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options) {
  std::vector<bool> is_inlier(residuals.size());
  std::vector<double> burst_limits(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double part = before[i] ? 1 : kReturnPart;
    is_inlier[i] = terms.HasRange(i) ? std::abs(residuals[i]) <= part * options.reject_sigmas : before[i];
    burst_limits[i] = part * options.burst_sigmas;
  }
  for (const std::vector<std::size_t>& series : FindSeries(graph)) {
    ExtendBursts(series, residuals, burst_limits, is_inlier);
  }
  return is_inlier;
}

std::vector<bool> FindFirstInliers(const CheckedGraph& graph, const InitialValues& initial,
                                   const std::vector<double>& residuals, const LastSolution& last,
                                   const SolverOptions& options) {
  std::vector<bool> is_inlier(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const CheckedRange& range = graph.ranges[i];
    const bool is_old = (initial.is_warm[range.from] || graph.nodes[range.from].is_fixed) &&
                        (initial.is_warm[range.to] || graph.nodes[range.to].is_fixed);
    is_inlier[i] = is_old ? !last.rejected.contains({range.edge->from, range.edge->to})
                          : std::abs(residuals[i]) <= kNewRangeSlack * options.reject_sigmas;
  }
  return is_inlier;
}

}  // namespace moondb
