// GlMerger: the painter of the paper's Section 5.3 on OpenGL ES 3.1, exact to the byte.
//
// Per tile of the merged map one instanced draw: blocks and footprints as quads, largest key first; the fragment
// shader repeats the CPU's integer additions, and the depth test keeps the first known value of each cell. One
// read-back a tile brings value, slot and level.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "actors/merge/merger.h"

namespace moondb {

class EglContext;

class GlMerger final : public Merger {
 public:
  struct Options {
    std::int32_t tile_cells_max = 4096;        // A side of one draw's target; the driver's limit counts too.
    std::int32_t atlas_page_cells_max = 2048;  // At least kBlockSideCellsMax.
  };

  // kUnavailable without a driver; kInternal if it does not take the shaders.
  static Result<std::unique_ptr<GlMerger>> Create(Options options);
  ~GlMerger() override;

  Result<MergeResult> Merge(const MapPlacement& placement, const StopPredicate& stop) override;
  using Merger::Merge;
  std::string name() const override { return "gl"; }
  std::string description() const override;

  bool is_software() const;  // Drawn by the CPU: llvmpipe, softpipe.

 private:
  class Painter;
  explicit GlMerger(std::unique_ptr<EglContext> context);

  std::unique_ptr<EglContext> context_;
  std::unique_ptr<Painter> painter_;  // All that needs the context to be current.
};

}  // namespace moondb
