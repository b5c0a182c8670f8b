// Exports a merged map as an occupancy grid, in the two files that ROS map servers and Nav2 load: map.yaml and map.pgm.
//
// Row 0 of the image has the largest y. Pixels: 254 free, 0 occupied (hazard), 205 unknown. free_thresh is 0.196,
// because unknown cells would load as free with 0.25. Numbers are written with all digits, whereas ROS's own saver
// rounds 0.0125 to 0.013.
#pragma once

#include <string>

#include "model/file_notes.h"
#include "model/grid.h"

namespace moondb {

// Return the bytes of the two files. The notes become comments in the YAML file. Requires: the map is not empty, and
// `image_name` is a file name without a folder.
std::string RosMapPgm(const Grid& grid);
std::string RosMapYaml(const MergedMap& map, const std::string& image_name, const FileNotes& notes = {});

}  // namespace moondb
