// OffsetRefinement: improves the relative pose of two maps by Gauss-Newton on the distances of each map's hazards to
// the hazards of the other, with a Geman-McClure loss. Immutable and usable on any thread.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "actors/registration/distance_field.h"
#include "actors/registration/planar_offset.h"

namespace moondb {

// An estimate of an offset before its refinement: x, y (m) and yaw (rad).
struct OffsetPrior {
  PlanarOffset expected;
  Eigen::Matrix3d information;  // Inverse of the covariance.
};

class OffsetRefinement {
 public:
  struct Side {
    std::vector<Eigen::Vector2d> points_m;  // Hazards in the frame of the map.
    const DistanceField& distances;         // Must outlive the refinement.
  };

  OffsetRefinement(Side first, Side second) : first_(std::move(first)), second_(std::move(second)) {}

  // Moves `first_from_second` to the nearest minimum. `loss_m`: distance at which a point has a quarter of its weight.
  // With a prior, the offset stays where the maps say nothing, as along a corridor.
  void Run(PlanarOffset& first_from_second, double loss_m, const OffsetPrior* prior = nullptr) const;
  // Returns the covariance of x, y (m) and yaw (rad) for points with a sigma of 5 cm, times 40. map_matching.h gives
  // the reasons for this factor.
  Eigen::Matrix3d CovarianceAt(const PlanarOffset& first_from_second, double loss_m) const;

 private:
  void Accumulate(const PlanarOffset& offset, double loss_m, Eigen::Matrix3d& hessian, Eigen::Vector3d& gradient) const;

  const Side first_;
  const Side second_;
};

}  // namespace moondb
