#include "model/site.h"

#include <cmath>

namespace moondb {
namespace {

// WGS 84.
constexpr double kEquator_m = 6378137;
constexpr double kFlattening = 1 / 298.257223563;
constexpr double kEccentricitySquare = kFlattening * (2 - kFlattening);

double Radians(double degrees) { return degrees * M_PI / 180; }

// Returns Earth-centred, Earth-fixed coordinates.
std::array<double, 3> ToEarth(const GeographicPosition& position) {
  const double lat = Radians(position.lat_deg);
  const double lon = Radians(position.lon_deg);
  const double normal_m = kEquator_m / std::sqrt(1 - kEccentricitySquare * std::sin(lat) * std::sin(lat));
  const double from_axis_m = (normal_m + position.alt_m) * std::cos(lat);
  return {from_axis_m * std::cos(lon), from_axis_m * std::sin(lon),
          ((1 - kEccentricitySquare) * normal_m + position.alt_m) * std::sin(lat)};
}

}  // namespace

std::array<double, 3> ToMap(const proto::SiteConfig& site, const GeographicPosition& position) {
  const std::array<double, 3> origin = ToEarth({site.lat_deg(), site.lon_deg(), site.alt_m()});
  const std::array<double, 3> point = ToEarth(position);
  const double x = point[0] - origin[0];
  const double y = point[1] - origin[1];
  const double z = point[2] - origin[2];
  const double lat = Radians(site.lat_deg());
  const double lon = Radians(site.lon_deg());
  const double east_m = -std::sin(lon) * x + std::cos(lon) * y;
  const double outwards_m = std::cos(lon) * x + std::sin(lon) * y;
  const double north_m = -std::sin(lat) * outwards_m + std::cos(lat) * z;
  const double up_m = std::cos(lat) * outwards_m + std::sin(lat) * z;
  const double cosine = std::cos(site.north_yaw_rad());
  const double sine = std::sin(site.north_yaw_rad());
  return {east_m * sine + north_m * cosine, north_m * sine - east_m * cosine, up_m};
}

}  // namespace moondb
