// The merged map as an agent sends it: one zstd frame of one byte a cell. Plain function, any thread.
#pragma once

#include "model/error.h"
#include "model/traversability_map.h"
#include "proto/control.pb.h"

namespace moondb {

inline constexpr std::uint64_t kMergedCellsMax = 256ull * 1024 * 1024;

// kCorrupt if the frame does not hold width * height cells of 0, 1 or 2, or more than kMergedCellsMax. An empty map has
// no frame.
Result<MergedMap> DecodeMergedMap(const proto::MergeReply& reply);

}  // namespace moondb
