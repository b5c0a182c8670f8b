// Page shares: divides the limited pages of a merged map fairly among the origins of its maps and footprints.
//
// An item (a map or a footprint) takes each page that its bounding box touches. The level is the maximum number of
// pages per origin: the highest value at which the pages of the kept items of all origins together are within the
// limit. A page that several items or origins touch counts once in the total. An origin whose items take more pages
// than the level keeps its newest items, those with the highest age. This is max-min fairness, as in
// model/origin_quota.h: an origin with at most pages_max / (number of origins) pages keeps all its items, whatever the
// others have.
//
// The result depends only on the set of items, not on their order. Pure function, usable on any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "actors/merge/quantize.h"
#include "model/ids.h"
#include "model/origin_quota.h"

namespace moondb {

struct SharedItem {
  AgentId origin = 0;
  // Age of the map's record, or of the record of the footprint's node.
  RecordAge age;
  // Breaks ties between ages. Requires: two items of one origin differ in age or in this number.
  std::uint64_t number = 0;
  CellBox box;  // Requires: lies within the range of page numbers (PlaceMap).
};

// Returns the indices of the items that have no room, sorted. An item that alone takes more than `pages_max` pages
// never has room.
std::vector<std::size_t> FindItemsWithoutRoom(std::span<const SharedItem> items, std::size_t pages_max);

}  // namespace moondb
