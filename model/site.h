// Converts geographic coordinates to the frame `map` of a site. Thread-safe.
#pragma once

#include <array>

#include "proto/team.pb.h"

namespace moondb {

// A position in WGS 84, for example a GNSS fix.
struct GeographicPosition {
  double lat_deg = 0;
  double lon_deg = 0;  // East.
  double alt_m = 0;    // Above the ellipsoid.
};

// Returns x y z in the frame `map` (m). The frame is the local tangent plane at the site's origin, turned by
// north_yaw_rad. The horizontal error against the curved Earth is below 1 mm at 5 km from the origin; z is the height
// above the plane.
std::array<double, 3> ToMap(const proto::SiteConfig& site, const GeographicPosition& position);

}  // namespace moondb
