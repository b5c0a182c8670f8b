#include "model/site.h"

#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

proto::SiteConfig Site(double lat_deg, double lon_deg, double north_yaw_rad) {
  proto::SiteConfig site;
  site.set_lat_deg(lat_deg);
  site.set_lon_deg(lon_deg);
  site.set_alt_m(100);
  site.set_north_yaw_rad(north_yaw_rad);
  return site;
}

TEST(SiteTest, TheOriginIsZero) {
  for (const double coordinate : ToMap(Site(59.3, 15.2, 0.4), {59.3, 15.2, 100})) EXPECT_NEAR(coordinate, 0, 1e-9);
}

TEST(SiteTest, NorthEastAndUpFollowTheYawOfNorth) {
  // At the equator a second of arc is 30.922 m of longitude and 30.715 m of latitude.
  const double second_deg = 1.0 / 3600;
  const auto east = ToMap(Site(0, 10, M_PI / 2), {0, 10 + second_deg, 100});
  EXPECT_NEAR(east[0], 30.922, 1e-3) << "north is y, so east is x";
  EXPECT_NEAR(east[1], 0, 1e-6);
  const auto north = ToMap(Site(0, 10, 0), {second_deg, 10, 100});
  EXPECT_NEAR(north[0], 30.715, 1e-3) << "north is x";
  EXPECT_NEAR(north[1], 0, 1e-6);
  const auto also_east = ToMap(Site(0, 10, 0), {0, 10 + second_deg, 100});
  EXPECT_NEAR(also_east[1], -30.922, 1e-3) << "north is x, so east is -y";
  EXPECT_NEAR(ToMap(Site(-40, -70, 1), {-40, -70, 103.5})[2], 3.5, 1e-6);
}

}  // namespace
}  // namespace moondb
