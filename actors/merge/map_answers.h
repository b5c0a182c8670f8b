// Replies about the merged map: the sources of a cell's value, statistics, fully occluded maps, and changed tiles. Pure
// functions, called on the merger's thread. Requires: the Merger is up to date.
#pragma once

#include <cstddef>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "proto/map.pb.h"
#include "proto/retention.pb.h"

namespace moondb {

// Maximum number of observations per reply. Further ones are only counted.
inline constexpr int kMapObservationsMax = 200;
inline constexpr int kMapTilesMax = 16384;  // Maximum number of tiles per part of a reply.

// Also lists observations of quarantined maps, after all others.
proto::MapWhyReply WhyOf(const MapCollection& collection, const Merger& merger, const proto::MapWhyRequest& request);

// Sets all fields except `backend`.
proto::MapStatsReply StatsOf(const MapCollection& collection, const Merger& merger);

inline constexpr std::uint32_t kOccludedMapsMax = 4096;

// Returns the fully occluded maps: shared, placed maps that win no cell, sorted by record key. At most `records_max`
// and kOccludedMapsMax. Removing them does not change the merged map unless a pose moves.
proto::OccludedMapsReply OccludedMapsOf(const Merger& merger, std::uint32_t records_max);

// Returns tiles that touch the region and changed since `since_version`, starting after `request.after`. If
// `since_version` is 0, returns all tiles with a known cell. At most kMapTilesMax tiles and about `bytes_max`
// compressed bytes are returned. Returns kInternal if zstd fails. The caller sets the field `life`.
Result<proto::MapTilesReply> ChangedTiles(const Merger& merger, std::uint64_t since_version,
                                          const proto::MapTilesRequest& request, std::size_t bytes_max);

// Returns one zstd frame with one byte per cell.
Result<std::string> CompressCells(const Grid& grid);

}  // namespace moondb
