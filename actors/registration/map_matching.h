// MatchMaps: measures the relative pose of two local traversability maps from their hazards.
//
// 1. Search: finds the offset with the highest mean likelihood by best-first branch and bound over x, y and yaw, in
//    steps of 5 cm and 0.5 degrees. The search continues until the best offset at another place (more than 0.4 m or 5
//    degrees away) is known. A corridor or a row of equal rocks has a second place that fits nearly as well.
// 2. Refinement: Gauss-Newton on the distances of each map's points to the other map's hazards, with a Geman-McClure
//    loss of 12 cm.
// 3. Gates: a match with too few common points, with contradicting hazards or with a second place is refused.
//
// The covariance is that of the refinement for points with a sigma of 5 cm, times 40: 10 because neighbouring cells are
// correlated, and 4 because the result was optimistic on recorded missions.
//
// Deterministic. May run on any thread.
#pragma once

#include <Eigen/Core>
#include <string>

#include "actors/registration/hazard_field.h"
#include "actors/registration/planar_offset.h"

namespace moondb {

inline constexpr double kMatchedDistance_m = 0.10;  // A point is matched if a hazard lies within this distance.

// How far an offset may lie from the expected one.
struct MatchWindow {
  double side_m = 3;  // In x and in y, to either side.
  double yaw_rad = 0.2618;
};

struct MatchOptions {
  double overlap_min = 0.35;
  double matched_min = 0.65;
  double second_best_max = 0.90;
  double sigma_max_m = 0.10;
  int points_min = 60;
  // For sparse ground, where fewer than `points_min` but at least this many points overlap.
  int sparse_points_min = 30;
  double sparse_overlap_min = 0.2;
  double sparse_matched_min = 0.5;
  double sparse_second_best_max = 0.95;
  double sparse_sigma_min_m = 0.10;
};

enum class MatchVerdict {
  kAccepted,
  kFewPoints,      // Too few hazards, or too few of them in the other map's known area.
  kLittleOverlap,  // Too small a part of the hazards lies in the other map's known area.
  kContradicted,   // Too many hazards of one map have no hazard in the other.
  kSecondPlace,    // Another place fits nearly as well.
  kUncertain,      // The covariance is too large.
  kOutsideWindow,  // The refinement left the window.
};

// Returns "accepted", "few points", ...
std::string ToString(MatchVerdict verdict);

struct MatchResult {
  MatchVerdict verdict = MatchVerdict::kFewPoints;
  PlanarOffset first_from_second;
  // Covariance of x and y (m) in the frame of the first map, and of yaw (rad).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  int points = 0;      // Points in the other map's known area; the smaller number of the two maps.
  double overlap = 0;  // Their part of all points; the smaller of the two maps.
  double matched =
      0;  // Part of them with a hazard of the other map within kMatchedDistance_m; the smaller of the two maps.
  // Score of the best offset at another place, divided by the score of the match. An upper bound if it is below the
  // limit, and 1 if the search gave up.
  double second_best = 1;
  std::size_t work = 0;  // Number of squares of offsets that the search bounded; 1,000 take about 0.45 ms.
};

MatchResult MatchMaps(const HazardField& first, const HazardField& second, const PlanarOffset& expected,
                      const MatchWindow& window, const MatchOptions& options = {});

}  // namespace moondb
