// Answers about the merged map from a Merger that is up to date: why a cell is what it is, who still has a say, which
// tiles changed. Pure functions, on the merger's thread.
#pragma once

#include <cstddef>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "proto/map.pb.h"
#include "proto/retention.pb.h"

namespace moondb {

inline constexpr int kMapObservationsMax = 200;  // In one answer; others are counted.
inline constexpr int kMapTilesMax = 16384;       // In one part of an answer.

// Quarantined maps are asked too, behind all others.
proto::MapWhyReply WhyOf(const MapCollection& collection, const Merger& merger, const proto::MapWhyRequest& request);

// But for `backend`.
proto::MapStatsReply StatsOf(const MapCollection& collection, const Merger& merger);

inline constexpr std::uint32_t kOccludedMapsMax = 4096;

// Shared maps that are placed and win no cell, by record key; `records_max` at most, and kOccludedMapsMax. Without them
// the merged map is the same, as long as no pose moves.
proto::OccludedMapsReply OccludedMapsOf(const Merger& merger, std::uint32_t records_max);

// Tiles that touch the region and changed since `since_version` (0: all that know a cell), kMapTilesMax at most and
// as many as fit into `bytes_max` coded, from behind `request.after` on. kInternal if zstd fails. Life is the caller's
// to set.
Result<proto::MapTilesReply> ChangedTiles(const Merger& merger, std::uint64_t since_version,
                                          const proto::MapTilesRequest& request, std::size_t bytes_max);

// One zstd frame of one byte a cell.
Result<std::string> CompressCells(const Grid& grid);

}  // namespace moondb
