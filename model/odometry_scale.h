// Plausibility limits of a rover's odometry scale: the true length divided by the length from odometry, as estimated by
// a solve.
#pragma once

namespace moondb {

// Wheel slip and camera drift change the scale by a few per cent. A scale outside these limits has another cause, such
// as edges that are not odometry, wrong units, or wrong ranges.
inline constexpr double kOdometryScaleMin = 0.8;
inline constexpr double kOdometryScaleMax = 1.25;

inline bool IsPlausibleOdometryScale(double scale) {
  return scale >= kOdometryScaleMin && scale <= kOdometryScaleMax;  // False for NaN.
}

}  // namespace moondb
