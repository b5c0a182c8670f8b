// OpencvMerger: merges maps as is usual with ROS. It warps each layer into the merged map's frame by nearest-neighbour
// sampling. It copies the known cells of each layer over those of earlier layers, with the best layer last. Exists only
// if OpenCV is installed.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "actors/merge/placement.h"

namespace moondb {

class OpencvMerger {
 public:
  virtual ~OpencvMerger() = default;
  virtual void Merge(const CellBox& extent) = 0;
  virtual std::vector<Cell> cells() const = 0;  // Cells of the extent, row by row.
};

// Unpacks the layers into a new merger. Returns null if this build does not have OpenCV.
std::unique_ptr<OpencvMerger> MakeOpencvMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                               const MergeGrid& grid);

}  // namespace moondb
