// Exports a merged map as GeoTIFF, so GIS programs can show it at its position on the Moon.
//
// The file has one band of bytes, one pixel per cell: 0 unknown (GDAL's no-data value), 1 free, 2 hazard, with the
// colours of model/cell_colors.h. Coordinates are metres east and north of the site, in the azimuthal equidistant
// projection centred there, on a sphere of 1,737,400 m radius. The frame `map` is a plane that touches the Moon at the
// site; this projection preserves distances and directions from the site. A ModelTransformation tag holds the rotation
// to north, so the raster is not resampled.
#pragma once

#include <filesystem>
#include <string>

#include "model/error.h"
#include "model/file_notes.h"
#include "model/geometry.h"
#include "model/grid.h"

namespace moondb {

inline constexpr double kMoonRadius_m = 1'737'400;

// Position and orientation of the frame `map` on the Moon.
struct MapSite {
  double lat_deg = 0;
  double lon_deg = 0;        // Longitude, positive to the east.
  double north_yaw_rad = 0;  // The yaw of north in the frame `map`.
};

// Converts a position in the frame `map` to metres east and north of the site.
Eigen::Vector2d EastNorth(const MapSite& site, const Eigen::Vector2d& place_m);

// Returns the bytes of the GeoTIFF file. The notes are stored in the tag ImageDescription and in GDAL's metadata. Fails
// with kInvalid for an empty map, and with kInternal and libtiff's error text if libtiff fails.
Result<std::string> GeoTiffBytes(const MergedMap& map, const MapSite& site, const FileNotes& notes);

}  // namespace moondb
