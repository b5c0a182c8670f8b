// Decodes the merged map as sent by an agent, whole or in tiles: zstd frames with one byte per cell. Thread-safe.
#pragma once

#include <vector>

#include "model/error.h"
#include "model/grid.h"
#include "model/ids.h"
#include "proto/map.pb.h"

namespace moondb {

inline constexpr std::uint64_t kMergedCellsMax = 256ull * 1024 * 1024;

// Decodes a whole merged map. Fails with kCorrupt if reply.zstd_cells does not decode to width * height cells of value
// 0, 1 or 2, or if there are more than kMergedCellsMax cells. For an empty map (width or height 0), zstd_cells is not
// read.
Result<MergedMap> DecodeMergedMap(const proto::MergeReply& reply);

// A tile of the merged map. If no cell of the tile is known any more, all cells of `map` are unknown.
struct MergedTile {
  std::int64_t x = 0;  // Column of the tile. The tile's first cell is in column x * map.grid.width of the merged map.
  std::int64_t y = 0;
  MergedMap map;
};

struct MergedTiles {
  bool is_everything = false;  // If true, discard all tiles received earlier: cells outside of `tiles` are unknown.
  std::vector<MergedTile> tiles;
  // If not 0, the tiles are the map of this rover alone, in a frame of its own, because it is not placed
  // (MapStatsReply.frame_of).
  AgentId frame_of = 0;
};

inline constexpr std::uint32_t kTileSideCellsMax = 4096;
// Cells of all tiles that Client::NextMapTiles returns at once: 16,384 pages of 256 x 256, the most that an agent
// merges.
inline constexpr std::uint64_t kAllTilesCellsMax = 1ull << 30;
// Decodes tiles of the merged map. Fails with kCorrupt like DecodeMergedMap, and for tiles with a side of more than
// kTileSideCellsMax cells.
Result<std::vector<MergedTile>> DecodeMapTiles(const proto::MapTilesReply& reply);

}  // namespace moondb
