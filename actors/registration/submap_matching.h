// SubmapMatcher: finds how two submaps may lie over each other, over all rotations.
//
// 1. Rotations: the Hough spectrum of a submap is, for each of 180 directions, the sum of squares of the numbers of
//    hazards in strips of 20 cm across the direction. The best shifts of the two spectra, and each plus 180 degrees,
//    are tried. If no direction stands out, as on open ground, all rotations are tried.
// 2. Translations: correlation over shifts of up to 17 m, in cells of 20 cm. A hazard scores by its distance to the
//    other submap's nearest hazard, and loses if it lies in the other's free space; in both directions.
// 3. The best places, at least 1 m or 7 degrees apart, are refined and judged. A second place is kept: the search for
//    starts (start_search.h) decides between them with the other submaps.
//
// Evidence says how well a place is determined in its weaker direction: a corridor that fits along its length has
// almost none. With n the normal of the wall at a point, n n^T is added up over the matched points, and 2 n n^T is
// subtracted for each contradicting one. The evidence is twice the smaller eigenvalue of this matrix, divided by 100;
// the weaker submap decides. A straight wall counts for 6 m of its length only: how two long walls meet says little, as
// buildings of one outline show.
//
// Deterministic. About 30 ms for a pair, 300 ms on open ground. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "actors/registration/image_spectrum.h"
#include "actors/registration/offset_refinement.h"
#include "actors/registration/planar_offset.h"
#include "actors/registration/submap.h"

namespace moondb {

// Submaps with fewer common points say too little about a place.
inline constexpr int kSubmapCommonMin = 120;

// How the points of each of two submaps lie in the other submap.
struct SubmapOverlap {
  struct Counts {
    int common = 0;                                      // Points in the other submap's known area.
    int matched = 0;                                     // With a hazard of the other within 20 cm.
    int contradicted = 0;                                // In the other's free space, more than 35 cm from a hazard.
    Eigen::Matrix2d evidence = Eigen::Matrix2d::Zero();  // In the frame of the point's submap.

    // Returns the part of the common points that `count` is; 0 without common points.
    double Part(int count) const { return common == 0 ? 0 : static_cast<double>(count) / common; }
  };
  std::array<Counts, 2> of;  // The points of the first submap, and of the second.

  int Common() const;           // Common points of the submap that has fewer.
  double Matched() const;       // Part of the common points; the smaller of the two submaps.
  double Contradicted() const;  // Part of the common points; the larger of the two submaps.
  double Evidence() const;
};

SubmapOverlap CompareSubmaps(const Submap& first, const Submap& second, const PlanarOffset& first_from_second);

// Returns the offset at the nearest minimum of the distances and the prior.
PlanarOffset RefineSubmaps(const Submap& first, const Submap& second, const OffsetPrior& prior);

// A place of the second submap.
struct SubmapPlace {
  PlanarOffset first_from_second;
  // Covariance of x and y (m) along the axes of the first submap, and of yaw (rad).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double evidence = 0;
};

// A submap with what matching needs of it. About 1.5 MB.
class SubmapTemplate {
 public:
  explicit SubmapTemplate(std::shared_ptr<const Submap> submap);

  static constexpr int kDirections = 180;

  const Submap& submap() const { return *submap_; }
  const ImageSpectrum& spectrum() const { return spectrum_; }
  const std::array<double, kDirections>& hough() const { return hough_; }
  bool has_direction() const { return has_direction_; }

 private:
  std::shared_ptr<const Submap> submap_;
  ImageSpectrum spectrum_;
  std::array<double, kDirections> hough_ = {};
  bool has_direction_ = false;
};

// Matches one pair of submaps, some rotations at a time.
class SubmapMatcher {
 public:
  static constexpr std::size_t kStepRotations = 20;

  void Begin(std::shared_ptr<const SubmapTemplate> first, std::shared_ptr<const SubmapTemplate> second);
  // Tries up to kStepRotations rotations. Returns false once all were tried. Requires: Begin.
  bool Step();
  // Returns the places that pass, the best first, and forgets the pair. Requires: Step has returned false.
  std::vector<SubmapPlace> Finish();
  bool is_begun() const { return first_ != nullptr; }

 private:
  struct Peak {
    double score = 0;
    PlanarOffset offset;
  };
  void Correlate(double yaw_rad);

  std::shared_ptr<const SubmapTemplate> first_;
  std::shared_ptr<const SubmapTemplate> second_;
  std::vector<double> yaws_rad_;  // Rotations that are left.
  std::vector<Peak> peaks_;
  ImageSpectrum image_;
};

}  // namespace moondb
