// GlPainter: the paper's merger on OpenGL (Section 5.3): layers sorted by resolution and time, drawn over the whole map
// one after the other, the best last; a texture a layer, unknown discarded, footprints on top.
//
// Placed by floats as graphics do it, so that cells at the borders may differ from the exact mergers'. Needs a driver.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "actors/merge/placement.h"
#include "model/error.h"

namespace moondb {

class GlPainter {
 public:
  static Result<std::unique_ptr<GlPainter>> Create();
  ~GlPainter();

  // Uploads the layers.
  Result<void> Load(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid);

  // Draws everything and reads it back, row by row.
  Result<void> Merge(const CellBox& extent);

  const std::vector<Cell>& cells() const { return cells_; }

 private:
  class Context;
  explicit GlPainter(std::unique_ptr<Context> context);

  std::unique_ptr<Context> context_;
  std::vector<Cell> cells_;
};

}  // namespace moondb
