// Replies about the merged map: the sources of a cell's value, statistics, fully occluded maps, and changed tiles. Pure
// functions, called on the merger's thread. Requires: the Merger is up to date.
#pragma once

#include <cstddef>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "proto/map.pb.h"
#include "proto/retention.pb.h"

namespace moondb {

// Maximum number of observations per reply. Further observations are only counted.
inline constexpr int kMapObservationsMax = 200;
inline constexpr int kMapTilesMax = 16384;  // Maximum number of tiles per part of a reply.

// Returns the observations of the cell at the requested point, the winner first. Observations of quarantined maps come
// last.
proto::MapWhyReply WhyOf(const MapCollection& collection, const Merger& merger, const proto::MapWhyRequest& request);

// Sets all fields except `backend`.
proto::MapStatsReply StatsOf(const MapCollection& collection, const Merger& merger);

inline constexpr std::uint32_t kOccludedMapsMax = 4096;

// Returns the fully occluded maps: shared, placed maps that win no cell, sorted by record key. Returns at most
// `records_max` of them, and at most kOccludedMapsMax. Removing these maps does not change the merged map unless a pose
// moves.
proto::OccludedMapsReply OccludedMapsOf(const Merger& merger, std::uint32_t records_max);

// Returns the tiles that touch the region and changed since `since_version`, starting after `request.after`. If
// `since_version` is 0, returns all such tiles with a known cell. Stops after kMapTilesMax tiles or about `bytes_max`
// compressed bytes. Returns kInternal if zstd fails. The caller sets the field `life`.
Result<proto::MapTilesReply> ChangedTiles(const Merger& merger, std::uint64_t since_version,
                                          const proto::MapTilesRequest& request, std::size_t bytes_max);

// Compresses the cells, one byte per cell, into one zstd frame. Returns the frame.
Result<std::string> CompressCells(const Grid& grid);

}  // namespace moondb
