// Exports a merged map to file formats of other programs: ROS and Nav2, PNG with a world file, GeoTIFF. Not
// thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/file_notes.h"
#include "model/grid.h"
#include "proto/team.pb.h"

namespace moondb {

// Formats: "nav2" writes map.yaml and map.pgm, "png" writes map.png and map.pgw, "geotiff" writes map.tif. PNG and
// GeoTIFF omit the unknown area around the map, except for a margin. Every format includes the notes. Only GeoTIFF uses
// `site`.
struct MapExport {
  std::filesystem::path folder;  // Created if missing.
  std::string format;
  MergedMap map;
  proto::SiteConfig site;
  FileNotes notes;
};

// Returns the map as the files store it, after cropping.
MergedMap WrittenMap(const MapExport& exported);

// Writes all files together (see WriteTogether) and returns their paths. kInternal, with the path and a remedy, if a
// file cannot be written.
Result<std::vector<std::filesystem::path>> WriteMapFiles(const MapExport& exported);

// Returns the six lines of a world file for GIS programs, in metres in the frame `map`.
std::string WorldFile(const MergedMap& map);

}  // namespace moondb
