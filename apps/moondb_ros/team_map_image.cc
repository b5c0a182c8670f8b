#include "apps/moondb_ros/team_map_image.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace moondb {
namespace {

constexpr std::int64_t kFar_cells = std::numeric_limits<std::int64_t>::max() / 4;

// A range of cells along one axis; empty if `end` is not greater than `begin`.
struct Span {
  std::int64_t begin = kFar_cells;
  std::int64_t end = -kFar_cells;

  void Include(std::int64_t cell) {
    begin = std::min(begin, cell);
    end = std::max(end, cell + 1);
  }
  std::int64_t size() const { return end - begin; }
};

std::int64_t FloorToBlock(std::int64_t cell) {
  const std::int64_t rest = cell % TeamMapImage::kBlock_cells;
  return cell - (rest < 0 ? rest + TeamMapImage::kBlock_cells : rest);
}

Span ToBlocks(const Span& span) { return {FloorToBlock(span.begin), -FloorToBlock(-span.end)}; }

// Returns at most kSideMax_cells of `span`, around `cell` as far as `span` allows.
Span CutAround(const Span& span, std::int64_t cell) {
  if (span.size() <= TeamMapImage::kSideMax_cells) return span;
  const std::int64_t begin = std::clamp(FloorToBlock(cell - TeamMapImage::kSideMax_cells / 2), span.begin,
                                        span.end - TeamMapImage::kSideMax_cells);
  return {begin, begin + TeamMapImage::kSideMax_cells};
}

std::int8_t ValueOf(Cell cell) {
  if (cell == Cell::kUnknown) return -1;
  return cell == Cell::kHazard ? 100 : 0;
}

bool HasKnown(const Grid& grid) {
  return std::ranges::any_of(grid.cells, [](Cell cell) { return cell != Cell::kUnknown; });
}

}  // namespace

bool TeamMapImage::Add(const MergedTiles& tiles) {
  std::map<std::pair<std::int64_t, std::int64_t>, Tile> before;
  if (tiles.is_everything) before.swap(tiles_);
  bool is_changed = false;
  for (const MergedTile& tile : tiles.tiles) {
    resolution_um_ = tile.map.resolution_um;
    const std::pair<std::int64_t, std::int64_t> place(tile.x, tile.y);
    auto& known = tiles.is_everything ? before : tiles_;
    const auto old = known.find(place);
    const bool is_known = HasKnown(tile.map.grid);
    is_changed = is_changed || (old == known.end() ? is_known : old->second.grid != tile.map.grid);
    if (old != known.end()) known.erase(old);
    if (is_known) tiles_[place] = {tile.x * tile.map.grid.width, tile.y * tile.map.grid.height, tile.map.grid};
  }
  // Tiles that are left were in the old map alone.
  return is_changed || !before.empty();
}

std::optional<TeamMapImage::Picture> TeamMapImage::ToGrid(const Eigen::Vector2d& robot_m) const {
  Span x;
  Span y;
  for (const auto& [place, tile] : tiles_) {
    for (std::int32_t row = 0; row < tile.grid.height; ++row) {
      for (std::int32_t column = 0; column < tile.grid.width; ++column) {
        if (tile.grid.At(column, row) == Cell::kUnknown) continue;
        x.Include(tile.left_cell + column);
        y.Include(tile.bottom_cell + row);
      }
    }
  }
  if (x.size() <= 0) return std::nullopt;
  x = ToBlocks(x);
  y = ToBlocks(y);
  const double cell_m = resolution_um_ * 1e-6;
  Picture picture;
  picture.is_partial = std::max(x.size(), y.size()) > kSideMax_cells;
  x = CutAround(x, std::llround(robot_m.x() / cell_m));
  y = CutAround(y, std::llround(robot_m.y() / cell_m));
  RosGrid& grid = picture.grid;
  grid.resolution_m = cell_m;
  grid.width = static_cast<std::uint32_t>(x.size());
  grid.height = static_cast<std::uint32_t>(y.size());
  grid.frame_from_origin.position_m = {static_cast<double>(x.begin) * cell_m, static_cast<double>(y.begin) * cell_m, 0};
  grid.values.assign(std::size_t{grid.width} * grid.height, -1);
  for (const auto& [place, tile] : tiles_) {
    for (std::int32_t row = 0; row < tile.grid.height; ++row) {
      const std::int64_t to_row = tile.bottom_cell + row - y.begin;
      if (to_row < 0 || to_row >= y.size()) continue;
      for (std::int32_t column = 0; column < tile.grid.width; ++column) {
        const std::int64_t to_column = tile.left_cell + column - x.begin;
        if (to_column < 0 || to_column >= x.size()) continue;
        grid.values[static_cast<std::size_t>(to_row) * grid.width + static_cast<std::size_t>(to_column)] =
            ValueOf(tile.grid.At(column, row));
      }
    }
  }
  return picture;
}

}  // namespace moondb
