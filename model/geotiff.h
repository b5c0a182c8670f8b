// A merged map as GeoTIFF, which GIS programs lay on the Moon's surface.
//
// One band of bytes, one pixel a cell: 0 unknown (which GDAL is told is no data), 1 free, 2 hazard, with the colours of
// model/map_picture.h. Coordinates are metres east and north of the site, in the azimuthal equidistant projection about
// it on a sphere of 1,737,400 m: the frame `map` is a plane that touches the Moon there, and this projection keeps
// distances and directions from the site. The raster is turned by the site's north (ModelTransformation), not sampled
// anew. Pure functions but for the file.
#pragma once

#include <filesystem>
#include <string>

#include "model/error.h"
#include "model/file_notes.h"
#include "model/geometry.h"
#include "model/grid.h"

namespace moondb {

inline constexpr double kMoonRadius_m = 1'737'400;

// Where the frame `map` has its origin.
struct MapSite {
  double lat_deg = 0;
  double lon_deg = 0;        // East.
  double north_yaw_rad = 0;  // The yaw of north in the frame `map`.
};

// Metres east and north of the site, of a place in the frame `map`.
Eigen::Vector2d EastNorth(const MapSite& site, const Eigen::Vector2d& place_m);

// The bytes of the file. The notes become ImageDescription and GDAL's metadata. kInvalid for an empty map, kInternal
// with libtiff's words.
Result<std::string> GeoTiffBytes(const MergedMap& map, const MapSite& site, const FileNotes& notes);

}  // namespace moondb
