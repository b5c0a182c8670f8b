// OpencvMerger: merges maps as ROS programs usually do. It warps each layer into the merged map's frame by
// nearest-neighbour sampling, and copies the known cells over those of earlier layers. The best layer comes last.
// Exists only if OpenCV is installed.
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
  virtual std::vector<Cell> cells() const = 0;  // Cells of `extent`, row by row.
};

// Unpacks the layers into a new merger. Returns null if this build does not have OpenCV.
std::unique_ptr<OpencvMerger> MakeOpencvMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                               const MergeGrid& grid);

}  // namespace moondb
