#include "apps/moondb_replay/map_frame.h"

#include <algorithm>

namespace moondb {

MapFrame FrameOf(std::span<const MergedMap* const> maps, std::int64_t margin_cells) {
  MapFrame frame;
  for (const MergedMap* map : maps) {
    for (std::int32_t row = 0; row < map->grid.height; ++row) {
      for (std::int32_t column = 0; column < map->grid.width; ++column) {
        if (map->grid.At(column, row) == Cell::kUnknown) continue;
        const std::int64_t x = map->origin_cell_x + column, y = map->origin_cell_y + row;
        if (frame.is_empty()) frame = {x, y, x + 1, y + 1};
        frame = {std::min(frame.first_x, x), std::min(frame.first_y, y), std::max(frame.last_x, x + 1),
                 std::max(frame.last_y, y + 1)};
      }
    }
  }
  if (frame.is_empty()) return frame;
  return {frame.first_x - margin_cells, frame.first_y - margin_cells, frame.last_x + margin_cells,
          frame.last_y + margin_cells};
}

MergedMap InFrame(const MergedMap& map, const MapFrame& frame) {
  MergedMap framed;
  framed.resolution_um = map.resolution_um;
  framed.origin_cell_x = frame.first_x;
  framed.origin_cell_y = frame.first_y;
  if (frame.is_empty()) return framed;
  framed.grid = Grid(static_cast<std::int32_t>(frame.last_x - frame.first_x),
                     static_cast<std::int32_t>(frame.last_y - frame.first_y));
  const std::int64_t left = std::max(frame.first_x, map.origin_cell_x);
  const std::int64_t right = std::min(frame.last_x, map.origin_cell_x + map.grid.width);
  const std::int64_t bottom = std::max(frame.first_y, map.origin_cell_y);
  const std::int64_t top = std::min(frame.last_y, map.origin_cell_y + map.grid.height);
  for (std::int64_t y = bottom; y < top; ++y) {
    for (std::int64_t x = left; x < right; ++x) {
      framed.grid.At(static_cast<std::int32_t>(x - frame.first_x), static_cast<std::int32_t>(y - frame.first_y)) =
          map.grid.At(static_cast<std::int32_t>(x - map.origin_cell_x),
                      static_cast<std::int32_t>(y - map.origin_cell_y));
    }
  }
  return framed;
}

}  // namespace moondb
