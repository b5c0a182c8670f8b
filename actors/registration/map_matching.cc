#include "actors/registration/map_matching.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <climits>
#include <cmath>
#include <numbers>
#include <optional>
#include <queue>
#include <tuple>
#include <vector>

#include "actors/registration/offset_refinement.h"

namespace moondb {
namespace {

constexpr double kYawStep_rad = std::numbers::pi / 360;
constexpr std::size_t kSearchPointsMax = 300;
constexpr std::size_t kRefinePointsMax = 1000;
constexpr std::size_t kExpansionsMax = 40'000;
constexpr double kSamePlace_m = 0.4;
constexpr double kSamePlace_rad = 5 * std::numbers::pi / 180;
constexpr double kSecondWindowMin_m = 1.5;  // The second place is searched for at least this far.
constexpr double kLoss_m = 0.12;
constexpr double kSigmaMin_m = 0.04;
constexpr double kSigmaMin_rad = 0.3 * std::numbers::pi / 180;

bool IsSamePlace(const PlanarOffset& a, const PlanarOffset& b) {
  return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m) <= kSamePlace_m &&
         std::abs(WrappedAngle(a.yaw_rad - b.yaw_rad)) <= kSamePlace_rad;
}

struct Found {
  PlanarOffset offset;
  double second_best = 1;
};

// Best-first branch and bound. A node is a square of 2^level x 2^level offsets at one yaw. Its bound is the sum over
// the points of the largest likelihood that the point can reach in the square.
class PlaceSearch {
 public:
  PlaceSearch(const HazardField& field, const std::vector<Eigen::Vector2d>& points_m, const PlanarOffset& expected,
              const MatchWindow& window)
      : field_(field), expected_(expected) {
    cells_ = static_cast<int>(std::ceil(std::max(window.side_m, kSecondWindowMin_m) / HazardField::kCell_m));
    yaws_ = static_cast<int>(std::ceil(window.yaw_rad / kYawStep_rad));
    point_count_ = points_m.size();
    rotated_.reserve(static_cast<std::size_t>(2 * yaws_ + 1) * point_count_);
    for (int yaw = -yaws_; yaw <= yaws_; ++yaw) {
      const Eigen::Isometry2d transform = OffsetOf({0, yaw, 0, 0, 0}).ToTransform();
      FieldBox box = {{INT_MAX, INT_MAX}, {INT_MIN, INT_MIN}};
      for (const Eigen::Vector2d& point_m : points_m) {
        const Eigen::Vector2d moved_m = transform * point_m;
        const int column = field.ToCell(moved_m.x());
        const int row = field.ToCell(moved_m.y());
        rotated_.push_back({column, row});
        box.first = {std::min(box.first.column, column), std::min(box.first.row, row)};
        box.last = {std::max(box.last.column, column), std::max(box.last.row, row)};
      }
      boxes_.push_back(box);
    }
  }

  // Returns nullopt if the search would take too long. `second_best_max`: ratios below it need not be exact.
  std::optional<Found> Run(double second_best_max) {
    constexpr int kTop = HazardField::kLevels - 1;
    for (int yaw = -yaws_; yaw <= yaws_; ++yaw) {
      for (int y = -cells_; y <= cells_; y += 1 << kTop) {
        for (int x = -cells_; x <= cells_; x += 1 << kTop) Push({0, yaw, kTop, x, y});
      }
    }
    std::optional<Node> best;
    for (std::size_t expansions = 0; !queue_.empty();) {
      const Node node = queue_.top();
      queue_.pop();
      if (best && node.bound <= second_best_max * best->bound) {
        return Found{OffsetOf(*best), static_cast<double>(node.bound) / best->bound};
      }
      if (node.level > 0) {
        if (++expansions > kExpansionsMax) return std::nullopt;
        Expand(node);
        continue;
      }
      const PlanarOffset offset = OffsetOf(node);
      if (!best) {
        best = node;
      } else if (!IsSamePlace(OffsetOf(*best), offset)) {
        return Found{OffsetOf(*best), static_cast<double>(node.bound) / best->bound};
      }
    }
    return Found{best ? OffsetOf(*best) : expected_, 0};
  }

  std::size_t work() const { return work_; }  // Number of nodes that were bounded.

 private:
  struct Node {
    std::uint32_t bound = 0;
    int yaw = 0;
    int level = 0;
    int x = 0;
    int y = 0;

    // A total order, so that the result does not depend on the queue.
    bool operator<(const Node& other) const {
      return std::tie(bound, other.level, other.yaw, other.y, other.x) < std::tie(other.bound, level, yaw, y, x);
    }
  };

  PlanarOffset OffsetOf(const Node& node) const {
    return {expected_.x_m + node.x * HazardField::kCell_m, expected_.y_m + node.y * HazardField::kCell_m,
            expected_.yaw_rad + node.yaw * kYawStep_rad};
  }

  void Push(Node node) {
    const auto yaw = static_cast<std::size_t>(node.yaw + yaws_);
    const std::span<const FieldCell> points(&rotated_[yaw * point_count_], point_count_);
    ++work_;
    node.bound = field_.SumOfLikelihoods(node.level, points, boxes_[yaw], node.x, node.y);
    queue_.push(node);
  }

  void Expand(const Node& node) {
    const int half = 1 << (node.level - 1);
    for (const int y : {node.y, node.y + half}) {
      for (const int x : {node.x, node.x + half}) {
        if (x <= cells_ && y <= cells_) Push({0, node.yaw, node.level - 1, x, y});
      }
    }
  }

  const HazardField& field_;
  std::size_t work_ = 0;
  const PlanarOffset expected_;
  int cells_ = 0;
  int yaws_ = 0;
  std::size_t point_count_ = 0;
  std::vector<FieldCell> rotated_;  // By yaw, then by point, at the expected position.
  std::vector<FieldBox> boxes_;     // By yaw.
  std::priority_queue<Node> queue_;
};

// Counts the points of both fields at the offset, and fills the figures and the covariance of the result.
void Judge(const HazardField& first, const HazardField& second, const OffsetRefinement& refinement,
           MatchResult& result) {
  const Eigen::Isometry2d first_from_second = result.first_from_second.ToTransform();
  const Eigen::Isometry2d second_from_first = first_from_second.inverse();
  int seen[2] = {0, 0};
  int near[2] = {0, 0};
  const auto count = [&](int side, const DistanceField::Distance& distance) {
    if (!distance.is_known && distance.distance_m > kMatchedDistance_m) return;
    ++seen[side];
    if (distance.distance_m <= kMatchedDistance_m) ++near[side];
  };
  for (const Eigen::Vector2d& point_m : second.points_m()) count(0, first.DistanceAt(first_from_second * point_m));
  for (const Eigen::Vector2d& point_m : first.points_m()) count(1, second.DistanceAt(second_from_first * point_m));
  const auto ratio = [](int part, std::size_t whole) { return whole == 0 ? 0.0 : part / static_cast<double>(whole); };
  result.points = std::min(seen[0], seen[1]);
  result.overlap = std::min(ratio(seen[0], second.points_m().size()), ratio(seen[1], first.points_m().size()));
  result.matched = std::min(ratio(near[0], seen[0]), ratio(near[1], seen[1]));
  result.covariance = refinement.CovarianceAt(result.first_from_second, kLoss_m);
  result.covariance.diagonal() = result.covariance.diagonal().cwiseMax(
      Eigen::Vector3d(kSigmaMin_m * kSigmaMin_m, kSigmaMin_m * kSigmaMin_m, kSigmaMin_rad * kSigmaMin_rad));
}

}  // namespace

std::string ToString(MatchVerdict verdict) {
  switch (verdict) {
    case MatchVerdict::kAccepted:
      return "accepted";
    case MatchVerdict::kFewPoints:
      return "few points";
    case MatchVerdict::kLittleOverlap:
      return "little overlap";
    case MatchVerdict::kContradicted:
      return "contradicted";
    case MatchVerdict::kSecondPlace:
      return "second place";
    case MatchVerdict::kUncertain:
      return "uncertain";
    case MatchVerdict::kOutsideWindow:
      return "outside window";
  }
  return "unknown";
}

MatchResult MatchMaps(const HazardField& first, const HazardField& second, const PlanarOffset& expected,
                      const MatchWindow& window, const MatchOptions& options) {
  MatchResult result;
  result.first_from_second = expected;
  const std::size_t least = std::min(first.points_m().size(), second.points_m().size());
  if (least < static_cast<std::size_t>(options.sparse_points_min)) return result;
  const bool is_sparse_pair = least < static_cast<std::size_t>(options.points_min);
  const double second_best_max = is_sparse_pair ? options.sparse_second_best_max : options.second_best_max;
  PlaceSearch search(first, SamplePoints(second.points_m(), kSearchPointsMax), expected, window);
  const std::optional<Found> found = search.Run(second_best_max);
  result.work = search.work();
  if (!found) {
    result.verdict = MatchVerdict::kSecondPlace;
    return result;
  }
  result.first_from_second = found->offset;
  result.second_best = found->second_best;
  const OffsetRefinement refinement({SamplePoints(first.points_m(), kRefinePointsMax), first.distances()},
                                    {SamplePoints(second.points_m(), kRefinePointsMax), second.distances()});
  refinement.Run(result.first_from_second, kLoss_m);
  Judge(first, second, refinement, result);
  const bool is_sparse = result.points < options.points_min;
  if (result.points < options.sparse_points_min) {
    result.verdict = MatchVerdict::kFewPoints;
  } else if (result.second_best > (is_sparse ? options.sparse_second_best_max : options.second_best_max)) {
    result.verdict = MatchVerdict::kSecondPlace;
  } else if (result.overlap < (is_sparse ? options.sparse_overlap_min : options.overlap_min)) {
    result.verdict = MatchVerdict::kLittleOverlap;
  } else if (result.matched < (is_sparse ? options.sparse_matched_min : options.matched_min)) {
    result.verdict = MatchVerdict::kContradicted;
  } else if (std::abs(result.first_from_second.x_m - expected.x_m) > window.side_m ||
             std::abs(result.first_from_second.y_m - expected.y_m) > window.side_m ||
             std::abs(WrappedAngle(result.first_from_second.yaw_rad - expected.yaw_rad)) > window.yaw_rad) {
    result.verdict = MatchVerdict::kOutsideWindow;
  } else if (WorstSigma_m(result.covariance) > options.sigma_max_m) {
    result.verdict = MatchVerdict::kUncertain;
  } else {
    result.verdict = MatchVerdict::kAccepted;
    if (is_sparse) {
      const double variance = options.sparse_sigma_min_m * options.sparse_sigma_min_m;
      result.covariance.diagonal().head<2>() = result.covariance.diagonal().head<2>().cwiseMax(variance);
    }
  }
  return result;
}

}  // namespace moondb
