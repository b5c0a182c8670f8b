// Grids of cells: layers of local traversability maps, merged maps, and the packing of cells in records
// (proto/record.proto, MapLayer).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"

namespace moondb {

enum class Cell : std::uint8_t { kUnknown = 0, kFree = 1, kHazard = 2 };

// A row-major grid of cells; row 0 has the smallest y.
struct Grid {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<Cell> cells;  // width * height cells, row by row.

  Grid() = default;
  Grid(std::int32_t w, std::int32_t h, Cell fill = Cell::kUnknown);
  Cell At(std::int32_t column, std::int32_t row) const { return cells[static_cast<std::size_t>(row) * width + column]; }
  Cell& At(std::int32_t column, std::int32_t row) { return cells[static_cast<std::size_t>(row) * width + column]; }
  bool operator==(const Grid&) const = default;
};

struct MapLayer {
  Grid grid;
  std::uint32_t resolution_um = 0;
  double center_x_m = 0;
  double center_y_m = 0;

  double resolution_m() const { return resolution_um * 1e-6; }
};

// Limits of a map from a message or a file.
inline constexpr int kMapLayersMax = 16;
inline constexpr std::uint32_t kMapSideCellsMax = 16384;
inline constexpr std::uint64_t kMapCellsMax = 64ull * 1024 * 1024;  // Sum over all layers.
inline constexpr std::uint32_t kMapResolutionUmMax = 100'000'000;   // Equals 100 m.

// A merged map. The lower left corner of cell (0, 0) lies at origin_cell * resolution in the frame `map`.
struct MergedMap {
  Grid grid;
  std::uint32_t resolution_um = 0;
  std::int64_t origin_cell_x = 0;
  std::int64_t origin_cell_y = 0;
};

// Returns the part of the map that contains all known cells, plus a margin. Returns the map itself if no cell is known.
MergedMap CroppedToKnown(const MergedMap& map, std::int32_t margin_cells);

// Packs cells, four per byte (proto/record.proto, MapLayer.cells).
std::string PackCells(const Grid& grid);

// Unpacks cells. Fails with kInvalid if the number of bytes does not match width * height, a cell has the value 3, or a
// spare bit of the last byte is set.
Result<Grid> UnpackCells(std::int32_t width, std::int32_t height, std::string_view bytes);

}  // namespace moondb
