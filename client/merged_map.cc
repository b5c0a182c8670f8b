#include "client/merged_map.h"

#include <zstd.h>

#include <algorithm>

namespace moondb {

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
  const std::string& frame = reply.zstd_cells();
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != count) {
    return Fail(ErrorCode::kCorrupt, "the merged map's cells do not fit its size");
  }
  map.grid = Grid(static_cast<std::int32_t>(reply.width_cells()), static_cast<std::int32_t>(reply.height_cells()));
  static_assert(sizeof(Cell) == 1);
  const std::size_t written = ZSTD_decompress(map.grid.cells.data(), count, frame.data(), frame.size());
  const bool is_valid = written == count && std::all_of(map.grid.cells.begin(), map.grid.cells.end(),
                                                        [](Cell cell) { return cell <= Cell::kHazard; });
  if (!is_valid) return Fail(ErrorCode::kCorrupt, "the merged map's cells do not decode");
  return map;
}

}  // namespace moondb
