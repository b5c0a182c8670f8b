#include "model/ros_map.h"

#include "model/text.h"

namespace moondb {

namespace {

constexpr double kRosMicrometresPerMetre = 1e6;

char RosPixelOf(Cell cell) {
  switch (cell) {
    case Cell::kFree:
      return static_cast<char>(254);
    case Cell::kHazard:
      return static_cast<char>(0);
    case Cell::kUnknown:
      return static_cast<char>(205);
  }
  return static_cast<char>(205);
}

// Formats whole micrometres as metres, without a rounding error in the text. Divides, because multiplying by 1e-6 would
// round twice.
std::string Metres(double micrometres) { return FormatDouble(micrometres / kRosMicrometresPerMetre); }

}  // namespace

std::string RosMapPgm(const Grid& grid) {
  std::string bytes = "P5\n" + std::to_string(grid.width) + " " + std::to_string(grid.height) + "\n255\n";
  bytes.reserve(bytes.size() + grid.cells.size());
  for (std::int32_t row = grid.height - 1; row >= 0; --row) {
    for (std::int32_t column = 0; column < grid.width; ++column) bytes += RosPixelOf(grid.At(column, row));
  }
  return bytes;
}

std::string RosMapYaml(const MergedMap& map, const std::string& image_name, const FileNotes& notes) {
  const double resolution_um = map.resolution_um;
  return NotesText(notes, "# ") + "image: " + image_name + "\nmode: trinary\nresolution: " + Metres(resolution_um) +
         "\norigin: [" + Metres(static_cast<double>(map.origin_cell_x) * resolution_um) + ", " +
         Metres(static_cast<double>(map.origin_cell_y) * resolution_um) +
         ", 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
}

}  // namespace moondb
