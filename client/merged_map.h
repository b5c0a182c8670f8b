// The merged map as an agent sends it, whole or in tiles: zstd frames of one byte a cell. Plain functions, any thread.
#pragma once

#include <vector>

#include "model/error.h"
#include "model/grid.h"
#include "proto/map.pb.h"

namespace moondb {

inline constexpr std::uint64_t kMergedCellsMax = 256ull * 1024 * 1024;

// kCorrupt if the frame does not hold width * height cells of 0, 1 or 2, or more than kMergedCellsMax. An empty map has
// no frame.
Result<MergedMap> DecodeMergedMap(const proto::MergeReply& reply);

// A part of the merged map; its cells are all unknown where nothing is known any more.
struct MergedTile {
  std::int64_t x = 0;  // Column of tiles: its first cell is x * map.grid.width.
  std::int64_t y = 0;
  MergedMap map;
};

struct MergedTiles {
  bool is_everything = false;  // What was known before counts no more: elsewhere nothing is known.
  std::vector<MergedTile> tiles;
};

// kCorrupt as above, and for a tile of more than kTileSideCellsMax cells a side.
inline constexpr std::uint32_t kTileSideCellsMax = 4096;
Result<std::vector<MergedTile>> DecodeMapTiles(const proto::MapTilesReply& reply);

}  // namespace moondb
