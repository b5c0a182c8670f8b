// Replies about the merged map: the sources of a cell's value, statistics, fully occluded maps, and changed tiles.
// Requires: the calling thread is the Merger's thread, and the Merger is up to date.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/merge/cleared_hazards.h"
#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "proto/map.pb.h"
#include "proto/retention.pb.h"

namespace moondb {

// Maximum number of observations per reply. Further observations are only counted.
inline constexpr int kMapObservationsMax = 200;
inline constexpr int kMapTilesMax = 16384;  // Maximum number of tiles per reply.

// Returns the observations of the cell at the requested point, the winner first. Observations of quarantined maps come
// last.
proto::MapWhyReply WhyOf(const MapCollection& collection, const Merger& merger, const proto::MapWhyRequest& request);

// Returns the statistics of the merged map. The caller sets `backend` and `refused_map_count`.
proto::MapStatsReply StatsOf(const MapCollection& collection, const Merger& merger);

inline constexpr std::uint32_t kOccludedMapsMax = 4096;

// Returns the fully occluded maps: shared maps that win no cell, sorted by record key. Returns at most `records_max` of
// them, and at most kOccludedMapsMax. Removing these maps does not change the merged map unless a pose moves. A map at
// a raw pose will move with the next solve. Such a map does not count, nor does a map in whose tiles one lies.
proto::OccludedMapsReply OccludedMapsOf(const MapCollection& collection, const Merger& merger,
                                        std::uint32_t records_max);

// Returns the tiles that touch the region and changed since `since_version`, starting after `request.after`. If
// `since_version` is 0, returns all such tiles with a known cell. Stops after kMapTilesMax tiles or about `bytes_max`
// compressed bytes. Returns kInternal if zstd fails. The caller sets `merger_id`.
Result<proto::MapTilesReply> ChangedTiles(const Merger& merger, std::uint64_t since_version,
                                          const proto::MapTilesRequest& request, std::size_t bytes_max);

void AddCleared(const std::vector<ClearedHazards>& cleared, const MergeGrid& grid, proto::MapStatsReply& reply);

// Adds the rovers that are not placed.
void AddUnplaced(const MapCollection::Selected& selected,
                 google::protobuf::RepeatedPtrField<proto::UnplacedRover>& unplaced);

// Adds the rovers whose newer maps wait for the next solve.
void AddCut(const MapCollection::Selected& selected, google::protobuf::RepeatedPtrField<proto::CutRover>& cut);

// Adds the maps and footprints that a merged map leaves out, by agent.
void AddLeftOut(const Merger& merger, const Crop& crop, proto::MergeReply& reply);

// Returns the cells, one byte each, as one compressed zstd frame. Returns kFull if the frame has more than `bytes_max`
// bytes, and kInternal if zstd fails. Takes at most `bytes_max` bytes of memory for the frame.
Result<std::string> CompressCells(const Grid& grid, std::size_t bytes_max);

}  // namespace moondb
