// CpuMerger: the reference. Blocks from the largest key down; a cell keeps the first known value that it meets.
#pragma once

#include <string>

#include "actors/merge/merger.h"

namespace moondb {

class CpuMerger final : public Merger {
 public:
  Result<MergeResult> Merge(const MapPlacement& placement, const StopPredicate& stop) override;
  using Merger::Merge;
  std::string name() const override { return "cpu"; }
  std::string description() const override { return "cpu"; }
};

}  // namespace moondb
