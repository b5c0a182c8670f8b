#include "client/merged_map.h"

#include <zstd.h>

#include <algorithm>

namespace moondb {

namespace {

Result<Grid> DecodeCells(const std::string& frame, std::uint32_t width, std::uint32_t height) {
  const std::uint64_t count = std::uint64_t{width} * height;
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != count) {
    return Fail(ErrorCode::kCorrupt, "the merged map's cells do not fit its size");
  }
  Grid grid(static_cast<std::int32_t>(width), static_cast<std::int32_t>(height));
  static_assert(sizeof(Cell) == 1);
  const std::size_t written = ZSTD_decompress(grid.cells.data(), count, frame.data(), frame.size());
  const bool is_valid = written == count && std::all_of(grid.cells.begin(), grid.cells.end(),
                                                        [](Cell cell) { return cell <= Cell::kHazard; });
  if (!is_valid) return Fail(ErrorCode::kCorrupt, "the merged map's cells do not decode");
  return grid;
}

// Returns whether the cells of a tile have indices that fit into 64 bits. `tile` is the tile's column or row.
bool IsNear(std::int64_t tile) {
  constexpr std::int64_t kMax = INT64_MAX / kTileSideCellsMax;
  return -kMax <= tile && tile <= kMax;
}

}  // namespace

Result<MergedMap> DecodeMergedMap(const proto::MergeReply& reply) {
  MergedMap map;
  map.resolution_um = reply.resolution_um();
  map.origin_cell_x = reply.origin_cell_x();
  map.origin_cell_y = reply.origin_cell_y();
  const std::uint64_t count = std::uint64_t{reply.width_cells()} * reply.height_cells();
  if (count == 0) return map;
  if (count > kMergedCellsMax || reply.width_cells() > kMergedCellsMax || reply.height_cells() > kMergedCellsMax) {
    return Fail(ErrorCode::kCorrupt, "the merged map is larger than a map may be");
  }
  Result<Grid> grid = DecodeCells(reply.zstd_cells(), reply.width_cells(), reply.height_cells());
  if (!grid) return tl::unexpected(grid.error());
  map.grid = *std::move(grid);
  return map;
}

Result<std::vector<MergedTile>> DecodeMapTiles(const proto::MapTilesReply& reply) {
  const std::uint32_t side = reply.tile_cells();
  const bool is_too_much =
      side > kTileSideCellsMax || std::uint64_t{side} * side * reply.tiles().size() > kMergedCellsMax;
  if (is_too_much || (side == 0 && !reply.tiles().empty())) {
    return Fail(ErrorCode::kCorrupt, "the merged map's tiles are larger than tiles may be");
  }
  std::vector<MergedTile> tiles;
  for (const proto::MapTile& coded : reply.tiles()) {
    MergedTile& tile = tiles.emplace_back();
    tile.x = coded.x();
    tile.y = coded.y();
    tile.map.resolution_um = reply.resolution_um();
    if (!IsNear(coded.x()) || !IsNear(coded.y())) {
      return Fail(ErrorCode::kCorrupt, "a tile of the merged map lies too far away");
    }
    tile.map.origin_cell_x = coded.x() * side;
    tile.map.origin_cell_y = coded.y() * side;
    if (coded.zstd_cells().empty()) {
      tile.map.grid = Grid(static_cast<std::int32_t>(side), static_cast<std::int32_t>(side));
      continue;
    }
    Result<Grid> grid = DecodeCells(coded.zstd_cells(), side, side);
    if (!grid) return tl::unexpected(grid.error());
    tile.map.grid = *std::move(grid);
  }
  return tiles;
}

}  // namespace moondb
