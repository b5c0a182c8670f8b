// Pictures of maps and tracks for people: panels with axes in metres, a scale bar, an arrow to north, and a legend.
//
// All panels of a picture show the same part of the frame `map`, so a place is at the same position in each. Colours
// are chosen to be distinguishable in grey and with any colour vision. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "apps/picture/tracks.h"
#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

// Colour and meaning of the cells of one value. If several cells share a pixel, the largest value is drawn.
struct RasterClass {
  Color color = {0, 0, 0};
  std::string name;  // Shown in the legend.
};

// A grid of small values. The lower left corner of cell (0, 0) lies at origin_cell * resolution in the frame `map`.
struct Raster {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::uint32_t resolution_um = 0;
  std::int64_t origin_cell_x = 0;
  std::int64_t origin_cell_y = 0;
  std::vector<std::uint8_t> cells;  // width * height indices of `classes`; row 0 has the smallest y.
  std::vector<RasterClass> classes;
};

// Returns the map's cells in the colours of unknown, free and hazard.
Raster RasterOf(const MergedMap& map);

struct Panel {
  std::string title;
  Raster raster;  // Empty: tracks on white.
  std::vector<Track> tracks;
};

struct Picture {
  std::vector<Panel> panels;  // From left to right.
  int panel_width_px = 640;   // 100 to 4,000. The height follows from the extent of rasters and tracks.
  double north_yaw_rad = std::numbers::pi / 2;  // Direction of north in the frame `map`. By REP 103, +y is north.
};

// Writes a PNG or an SVG file. Returns the errors of WriteDrawing (apps/picture/drawing.h). Leaves out points farther
// than 10 km from the median of all points, because one outlier would shrink everything else to a dot.
Result<void> WritePicture(const Picture& picture, const std::filesystem::path& file);

}  // namespace moondb
