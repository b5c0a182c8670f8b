// SubmapGraph: solves the poses of two rovers' submaps in the plane from odometry and places, by Gauss-Newton.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "actors/registration/planar_offset.h"

namespace moondb {

// Limit of a chi-square of three degrees of freedom, 99 %: a relative pose in the plane fits.
inline constexpr double kPlanarChiSquareMax = 11.3;

class SubmapGraph {
 public:
  // The relative pose from_from_to of two poses, with the covariance of x and y (m) along the axes of `from`, and yaw.
  struct Factor {
    std::size_t from = 0;
    std::size_t to = 0;
    PlanarOffset from_from_to;
    Eigen::Matrix3d covariance;
  };

  // `poses`: initial poses. The first one stays.
  explicit SubmapGraph(std::vector<PlanarOffset> poses = {}) : poses_(std::move(poses)) {}

  void Add(const Factor& factor) { factors_.push_back(factor); }
  void Solve();

  const std::vector<PlanarOffset>& poses() const { return poses_; }
  // Return the square of the distance of a factor from the solved poses in standard deviations. `with_poses`: with the
  // covariance of the solved poses too, for a factor that is not part of the graph.
  double ChiSquareOf(const Factor& factor, bool with_poses) const;
  // Returns the covariance of pose `to` relative to pose `from`, along the axes of `from`. Requires: Solve.
  Eigen::Matrix3d RelativeCovarianceOf(std::size_t from, std::size_t to) const;

 private:
  struct Linear {
    Eigen::Vector3d residual;
    Eigen::Matrix3d by_from;  // Derivatives.
    Eigen::Matrix3d by_to;
  };
  Linear Linearized(const Factor& factor) const;

  std::vector<PlanarOffset> poses_;
  std::vector<Factor> factors_;
  Eigen::MatrixXd covariance_;
};

}  // namespace moondb
