// Manifold: ceres::Manifold. For Ceres 2.0, which has LocalParameterization instead, an adapter with the same
// functions.
#pragma once

#include <ceres/problem.h>
#include <ceres/version.h>

#if CERES_VERSION_MAJOR > 2 || CERES_VERSION_MINOR > 0
#include <ceres/manifold.h>
#else
#include <ceres/local_parameterization.h>
#endif

namespace moondb {

#if CERES_VERSION_MAJOR > 2 || CERES_VERSION_MINOR > 0

using Manifold = ceres::Manifold;

inline ceres::Ownership& ManifoldOwnership(ceres::Problem::Options& options) { return options.manifold_ownership; }

#else

class Manifold : public ceres::LocalParameterization {
 public:
  virtual int AmbientSize() const = 0;
  virtual int TangentSize() const = 0;
  virtual bool PlusJacobian(const double* x, double* jacobian) const = 0;
  virtual bool Minus(const double* y, const double* x, double* y_minus_x) const = 0;
  virtual bool MinusJacobian(const double* x, double* jacobian) const = 0;

  int GlobalSize() const override { return AmbientSize(); }
  int LocalSize() const override { return TangentSize(); }
  bool ComputeJacobian(const double* x, double* jacobian) const override { return PlusJacobian(x, jacobian); }
};

inline ceres::Ownership& ManifoldOwnership(ceres::Problem::Options& options) {
  return options.local_parameterization_ownership;
}

#endif

}  // namespace moondb
