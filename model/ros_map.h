// ROS maps: a merged map as the two files that ROS's map servers and Nav2 load, map.yaml and map.pgm.
//
// The picture's row 0 has the largest y; 254 free, 0 occupied (hazard), 205 unknown. free_thresh is 0.196, since with
// 0.25 unknown would load as free. Numbers are written in full: ROS's own saver rounds 0.0125 to 0.013.
#pragma once

#include <filesystem>
#include <string>

#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

// Writes folder/basename.yaml and folder/basename.pgm, and makes the folder. kInvalid for an empty map, or a basename
// that is empty or holds other characters than letters, digits, '.', '-' and '_'; kInternal if a file cannot be
// written.
Result<void> WriteRosMap(const MergedMap& map, const std::filesystem::path& folder, const std::string& basename);

// The bytes of the two files.
std::string RosMapPgm(const Grid& grid);
std::string RosMapYaml(const MergedMap& map, const std::string& image_name);

}  // namespace moondb
