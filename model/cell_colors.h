// The colours of cells in map files and pictures.
#pragma once

#include <array>

#include "model/png.h"
#include "model/traversability_map.h"

namespace moondb {

inline constexpr int kCropMarginCells = 20;  // Unknown cells kept around a cropped map.

// Returns the colours of unknown, free and hazard cells: grey, light, dark red. The colours also differ in greyscale:
// any two have a contrast ratio of at least 2.5 to 1, and hazard and unknown have at least 3 to 1 (WCAG 2.1).
const std::array<Color, 3>& CellColors();

// Returns an image with one gray pixel per cell, +y up: 0 unknown, 1 free, 2 hazard. For file formats that store the
// colours in a palette. Thread-safe.
Image CellPicture(const MergedMap& map);

}  // namespace moondb
