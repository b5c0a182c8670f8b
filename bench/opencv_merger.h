// OpencvMerger: what map mergers of the ROS world do: warp each layer into the merged map's frame by nearest sampling,
// and copy what is known over what is there, the best layer last. Only where OpenCV is installed.
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
  virtual std::vector<Cell> cells() const = 0;  // Of the extent, row after row.
};

// Null without OpenCV. Unpacks the layers.
std::unique_ptr<OpencvMerger> MakeOpencvMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                               const MergeGrid& grid);

}  // namespace moondb
