// A merged map as files for others: ROS and Nav2, pictures with a world file, GeoTIFF. Not thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/file_notes.h"
#include "model/grid.h"
#include "proto/team.pb.h"

namespace moondb {

// "nav2": map.yaml and map.pgm. "png": map.png and map.pgw. "geotiff": map.tif. PNG and GeoTIFF leave out what is
// unknown around the map, but for a margin. Each holds the notes. `site` is of use to GeoTIFF alone.
struct MapExport {
  std::filesystem::path folder;  // Made where it is missing.
  std::string format;
  MergedMap map;
  proto::SiteConfig site;
  FileNotes notes;
};

// The map as its files hold it.
MergedMap WrittenMap(const MapExport& exported);

// The files written, together (see WriteTogether). kInternal, with the path and what to do, if one cannot be written.
Result<std::vector<std::filesystem::path>> WriteMapFiles(const MapExport& exported);

// Six lines, as GIS programs read them: metres in the frame `map`.
std::string WorldFile(const MergedMap& map);

}  // namespace moondb
