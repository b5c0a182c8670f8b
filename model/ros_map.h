// ROS maps: a merged map as the two files that ROS's map servers and Nav2 load, map.yaml and map.pgm.
//
// The picture's row 0 has the largest y; 254 free, 0 occupied (hazard), 205 unknown. free_thresh is 0.196, since with
// 0.25 unknown would load as free. Numbers are written in full: ROS's own saver rounds 0.0125 to 0.013.
#pragma once

#include <string>

#include "model/file_notes.h"
#include "model/grid.h"

namespace moondb {

// The bytes of the two files; the map is not empty, and `image_name` a plain name. The notes are comments of the yaml.
std::string RosMapPgm(const Grid& grid);
std::string RosMapYaml(const MergedMap& map, const std::string& image_name, const FileNotes& notes = {});

}  // namespace moondb
