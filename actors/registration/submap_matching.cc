#include "actors/registration/submap_matching.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kStrip_m = 0.2;
constexpr int kShifts = 3;
constexpr double kYawStep_rad = 1.5 * kRadians;
constexpr double kStandsOut = 1.3;

constexpr double kPixel_m = 0.2;
constexpr int kShiftMax = 85;  // 17 m.
constexpr double kScoreSigma_m = 0.2;
constexpr float kFreeScore = -0.6f;

constexpr std::size_t kPeaksOfRotation = 12;
constexpr std::size_t kPlaces = 6;
constexpr double kApart_m = 1;
constexpr double kApart_rad = 7 * kRadians;

constexpr std::size_t kRefinePointsMax = 1000;
constexpr double kWideLoss_m = 0.3;
constexpr double kNarrowLoss_m = 0.15;
constexpr double kMatched_m = 0.20;
constexpr double kContradicted_m = 0.35;
constexpr double kMatchedPartMin = 0.55;
constexpr double kContradictedPartMax = 0.30;
constexpr double kEvidenceMin = 0.3;
constexpr double kEvidencePoints = 100;
constexpr int kEvidencePointsOfWall = 60;  // 6 m.
constexpr double kSigmaMin_m = 0.15;
constexpr double kSigmaMin_rad = 0.015;

bool AreApart(const PlanarOffset& a, const PlanarOffset& b) {
  return (a.position_m() - b.position_m()).norm() > kApart_m ||
         std::abs(WrappedAngle(a.yaw_rad - b.yaw_rad)) > kApart_rad;
}

// Draws the hazards of a submap that is turned by `yaw_rad` into `hazards`, and the scores of hazards of another submap
// into `scores`.
void DrawImages(const Submap& submap, double yaw_rad, ImageSpectrum::Plane& hazards, ImageSpectrum::Plane& scores) {
  constexpr int kSide = ImageSpectrum::kSide;
  static const auto score_of = [] {
    std::array<float, 256> table;
    for (std::size_t i = 0; i < table.size(); ++i) {
      const double distance_m = static_cast<double>(i) * Submap::kCell_m / DistanceField::kUnits;
      const double sigmas = distance_m / kScoreSigma_m;
      table[i] = distance_m > kContradicted_m ? kFreeScore : static_cast<float>(std::exp(-sigmas * sigmas / 2));
    }
    return table;
  }();
  hazards.setZero();
  scores.setZero();
  const Eigen::Rotation2Dd turn(yaw_rad);
  const auto pixel = [](double coordinate_m) {
    return static_cast<int>(std::floor(coordinate_m / kPixel_m)) & (kSide - 1);
  };
  for (const Submap::Point& point : submap.points()) {
    const Eigen::Vector2d turned_m = turn * point.position_m;
    hazards(pixel(turned_m.y()), pixel(turned_m.x())) = 1;
  }
  const DistanceField& distances = submap.distances();
  const SquareGrid& grid = distances.grid();
  const double half_m = grid.side_cells / 2 * grid.cell_m;
  const double reach_m = half_m * (std::abs(std::cos(yaw_rad)) + std::abs(std::sin(yaw_rad)));
  const int reach = std::min(kSide / 2, static_cast<int>(std::ceil(reach_m / kPixel_m)));
  const Eigen::Vector2d step_x = Eigen::Rotation2Dd(-yaw_rad) * Eigen::Vector2d(kPixel_m / grid.cell_m, 0);
  const Eigen::Vector2d step_y = Eigen::Rotation2Dd(-yaw_rad) * Eigen::Vector2d(0, kPixel_m / grid.cell_m);
  for (int y = -reach; y < reach; ++y) {
    // In cells, from the corner of the submap's grid.
    Eigen::Vector2d at = (y + 0.5) * step_y + (-reach + 0.5) * step_x + Eigen::Vector2d::Constant(grid.side_cells / 2);
    for (int x = -reach; x < reach; ++x, at += step_x) {
      const int column = static_cast<int>(at.x());
      const int row = static_cast<int>(at.y());
      if (at.x() < 0 || at.y() < 0 || !grid.IsInside(column, row)) continue;
      const std::size_t index = grid.IndexOf(column, row);
      if (distances.IsKnown(index)) scores(y & (kSide - 1), x & (kSide - 1)) = score_of[distances.UnitsAt(index)];
    }
  }
}

std::vector<double> YawsOf(const SubmapTemplate& first, const SubmapTemplate& second) {
  std::vector<double> yaws_rad;
  if (!first.has_direction() || !second.has_direction()) {
    for (double yaw_rad = -std::numbers::pi; yaw_rad < std::numbers::pi; yaw_rad += kYawStep_rad)
      yaws_rad.push_back(yaw_rad);
    return yaws_rad;
  }
  constexpr int kCount = SubmapTemplate::kDirections;
  std::array<double, kCount> fits = {};
  for (int shift = 0; shift < kCount; ++shift) {
    for (int i = 0; i < kCount; ++i) {
      fits[static_cast<std::size_t>(shift)] += first.hough()[static_cast<std::size_t>(i)] *
                                               second.hough()[static_cast<std::size_t>((i - shift + kCount) % kCount)];
    }
  }
  std::vector<int> peaks;
  for (int i = 0; i < kCount; ++i) {
    const double at = fits[static_cast<std::size_t>(i)];
    if (at > fits[static_cast<std::size_t>((i + kCount - 1) % kCount)] &&
        at >= fits[static_cast<std::size_t>((i + 1) % kCount)])
      peaks.push_back(i);
  }
  std::ranges::stable_sort(
      peaks, [&](int a, int b) { return fits[static_cast<std::size_t>(a)] > fits[static_cast<std::size_t>(b)]; });
  peaks.resize(std::min<std::size_t>(peaks.size(), kShifts));
  for (const int peak : peaks) {
    for (const double half : {0.0, std::numbers::pi}) {
      for (const int step : {0, -1, 1}) yaws_rad.push_back(WrappedAngle(peak * kRadians + half + step * kYawStep_rad));
    }
  }
  return yaws_rad;
}

OffsetRefinement RefinementOf(const Submap& first, const Submap& second) {
  const auto side = [](const Submap& submap) {
    std::vector<Eigen::Vector2d> positions_m;
    for (const Submap::Point& point : submap.points()) positions_m.push_back(point.position_m);
    return OffsetRefinement::Side{SamplePoints(positions_m, kRefinePointsMax), submap.distances()};
  };
  return {side(first), side(second)};
}

double SmallerEigenvalue(const Eigen::Matrix2d& matrix) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(matrix, Eigen::EigenvaluesOnly);
  return solver.eigenvalues()(0);
}

}  // namespace

int SubmapOverlap::Common() const { return std::min(of[0].common, of[1].common); }

double SubmapOverlap::Matched() const { return std::min(of[0].Part(of[0].matched), of[1].Part(of[1].matched)); }

double SubmapOverlap::Contradicted() const {
  return std::max(of[0].Part(of[0].contradicted), of[1].Part(of[1].contradicted));
}

double SubmapOverlap::Evidence() const {
  return 2 * std::min(SmallerEigenvalue(of[0].evidence), SmallerEigenvalue(of[1].evidence)) / kEvidencePoints;
}

SubmapOverlap CompareSubmaps(const Submap& first, const Submap& second, const PlanarOffset& first_from_second) {
  SubmapOverlap overlap;
  const auto count = [](const Submap& from, const Submap& to, const Eigen::Isometry2d& to_from,
                        SubmapOverlap::Counts& counts) {
    std::vector<int> of_wall(static_cast<std::size_t>(from.wall_count()));  // Matched points.
    for (const Submap::Point& point : from.points()) {
      const DistanceField::Distance distance = to.distances().At(to_from * point.position_m);
      if (!distance.is_known) continue;
      ++counts.common;
      const Eigen::Matrix2d normal =
          point.is_corner ? Eigen::Matrix2d::Identity() : Eigen::Matrix2d(point.normal * point.normal.transpose());
      if (distance.distance_m <= kMatched_m) {
        ++counts.matched;
        const bool counts_more =
            point.is_corner || ++of_wall[static_cast<std::size_t>(point.wall)] <= kEvidencePointsOfWall;
        if (counts_more) counts.evidence += normal;
      } else if (distance.distance_m > kContradicted_m) {
        ++counts.contradicted;
        counts.evidence -= 2 * normal;
      }
    }
  };
  const Eigen::Isometry2d transform = first_from_second.ToTransform();
  count(first, second, transform.inverse(), overlap.of[0]);
  count(second, first, transform, overlap.of[1]);
  return overlap;
}

PlanarOffset RefineSubmaps(const Submap& first, const Submap& second, const OffsetPrior& prior) {
  const OffsetRefinement refinement = RefinementOf(first, second);
  PlanarOffset first_from_second = prior.expected;
  refinement.Run(first_from_second, kWideLoss_m, &prior);
  refinement.Run(first_from_second, kNarrowLoss_m, &prior);
  return first_from_second;
}

SubmapTemplate::SubmapTemplate(std::shared_ptr<const Submap> submap) : submap_(std::move(submap)) {
  // Y = scores - i hazards (see Correlate).
  DrawImages(*submap_, 0, spectrum_.imaginary(), spectrum_.real());
  spectrum_.imaginary() = -spectrum_.imaginary();
  spectrum_.Transform();
  std::vector<int> strips;
  for (int direction = 0; direction < kDirections; ++direction) {
    const double cosine = std::cos(direction * kRadians);
    const double sine = std::sin(direction * kRadians);
    constexpr int kHalf = static_cast<int>(Submap::kSideMax_m / kStrip_m);
    strips.assign(2 * kHalf, 0);
    for (const Submap::Point& point : submap_->points()) {
      const double across_m = cosine * point.position_m.x() + sine * point.position_m.y();
      ++strips[static_cast<std::size_t>(
          std::clamp(static_cast<int>(std::floor(across_m / kStrip_m)) + kHalf, 0, 2 * kHalf - 1))];
    }
    double sum = 0;
    for (const int strip : strips) sum += static_cast<double>(strip) * strip;
    hough_[static_cast<std::size_t>(direction)] = sum;
  }
  const double mean = std::accumulate(hough_.begin(), hough_.end(), 0.0) / kDirections;
  has_direction_ = *std::ranges::max_element(hough_) > kStandsOut * mean;
  for (double& value : hough_) value = mean > 0 ? value / mean - 1 : 0;
}

// With Y = scores - i hazards of the first submap and Z = hazards - i scores of the second, the real part of the
// correlation at a shift is the sum of two scores. One is that of the second submap's hazards in the first; the other
// is the reverse.
void SubmapMatcher::Correlate(double yaw_rad) {
  constexpr int kSide = ImageSpectrum::kSide;
  DrawImages(second_->submap(), yaw_rad, image_.real(), image_.imaginary());
  image_.imaginary() = -image_.imaginary();
  image_.Transform();
  image_.Correlate(first_->spectrum());
  const ImageSpectrum::Plane& scores = image_.real();
  std::vector<Peak> found;
  for (int y = -kShiftMax; y <= kShiftMax; ++y) {
    const auto row = [&](int of) { return &scores(of & (kSide - 1), 0); };
    const float* const rows[3] = {row(y - 1), row(y), row(y + 1)};
    for (int x = -kShiftMax; x <= kShiftMax; ++x) {
      const float at = rows[1][x & (kSide - 1)];
      const int left = (x - 1) & (kSide - 1);
      const int right = (x + 1) & (kSide - 1);
      if (at <= 0 || at < rows[1][left] || at < rows[1][right] || at < rows[0][x & (kSide - 1)] ||
          at < rows[2][x & (kSide - 1)])
        continue;
      found.push_back({at, {x * kPixel_m, y * kPixel_m, yaw_rad}});
    }
  }
  const std::size_t count = std::min(found.size(), kPeaksOfRotation);
  std::ranges::partial_sort(found, found.begin() + static_cast<std::ptrdiff_t>(count), {},
                            [](const Peak& peak) { return std::tuple(-peak.score, peak.offset.y_m, peak.offset.x_m); });
  peaks_.insert(peaks_.end(), found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count));
}

void SubmapMatcher::Begin(std::shared_ptr<const SubmapTemplate> first, std::shared_ptr<const SubmapTemplate> second) {
  first_ = std::move(first);
  second_ = std::move(second);
  peaks_.clear();
  yaws_rad_.clear();
  const auto count_of = [](const SubmapTemplate& of) { return of.submap().points().size(); };
  if (std::min(count_of(*first_), count_of(*second_)) >= kSubmapCommonMin) yaws_rad_ = YawsOf(*first_, *second_);
}

bool SubmapMatcher::Step() {
  Check(is_begun(), "a pair of submaps is matched");
  for (std::size_t i = 0; i < kStepRotations && !yaws_rad_.empty(); ++i) {
    Correlate(yaws_rad_.back());
    yaws_rad_.pop_back();
  }
  return !yaws_rad_.empty();
}

std::vector<SubmapPlace> SubmapMatcher::Finish() {
  Check(is_begun() && yaws_rad_.empty(), "all rotations were tried");
  const std::shared_ptr<const SubmapTemplate> first = std::exchange(first_, nullptr);
  const std::shared_ptr<const SubmapTemplate> second = std::exchange(second_, nullptr);
  const Submap& a = first->submap();
  const Submap& b = second->submap();
  std::ranges::stable_sort(peaks_, std::greater(), &Peak::score);
  std::vector<PlanarOffset> best;
  for (const Peak& peak : peaks_) {
    if (best.size() == kPlaces) break;
    if (std::ranges::all_of(best, [&](const PlanarOffset& other) { return AreApart(peak.offset, other); }))
      best.push_back(peak.offset);
  }
  const OffsetRefinement refinement = RefinementOf(a, b);
  const double sampled = static_cast<double>(std::min(a.points().size(), kRefinePointsMax) +
                                             std::min(b.points().size(), kRefinePointsMax)) /
                         static_cast<double>(a.points().size() + b.points().size());
  std::vector<SubmapPlace> places;
  for (PlanarOffset& offset : best) {
    refinement.Run(offset, kWideLoss_m);
    refinement.Run(offset, kNarrowLoss_m);
    if (std::ranges::any_of(places,
                            [&](const SubmapPlace& other) { return !AreApart(offset, other.first_from_second); }))
      continue;
    const SubmapOverlap overlap = CompareSubmaps(a, b, offset);
    if (overlap.Common() < kSubmapCommonMin || overlap.Matched() < kMatchedPartMin ||
        overlap.Contradicted() > kContradictedPartMax)
      continue;
    SubmapPlace place{offset, {}, overlap.Evidence()};
    if (place.evidence <= kEvidenceMin) continue;
    place.covariance = sampled * refinement.CovarianceAt(offset, kNarrowLoss_m);
    place.covariance +=
        Eigen::Vector3d(kSigmaMin_m * kSigmaMin_m, kSigmaMin_m * kSigmaMin_m, kSigmaMin_rad * kSigmaMin_rad)
            .asDiagonal();
    places.push_back(place);
  }
  return places;
}

}  // namespace moondb
