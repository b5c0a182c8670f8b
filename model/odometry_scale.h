// The odometry scale of a rover (true length over odometry's length), as a solve estimates it.
#pragma once

namespace moondb {

// Wheels slip and cameras drift by a few per cent. A scale outside these limits has another cause: edges that are no
// odometry, wrong units, or wrong ranges.
inline constexpr double kOdometryScaleMin = 0.8;
inline constexpr double kOdometryScaleMax = 1.25;

inline bool IsPlausibleOdometryScale(double scale) {
  return scale >= kOdometryScaleMin && scale <= kOdometryScaleMax;  // Not for NaN.
}

}  // namespace moondb
