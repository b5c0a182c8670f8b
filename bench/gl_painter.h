// GlPainter: the paper's merger on OpenGL (Section 5.3), a painter's algorithm. It sorts layers by resolution and time
// and draws them over the whole map one after the other, the best layer last. Each layer is a texture, unknown cells
// are discarded, and footprints are drawn on top.
//
// Places layers with floats, as graphics programs do. Cells at borders may therefore differ from those of the exact
// mergers. Needs an OpenGL driver.
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

  // Uploads the layers of the maps to the GPU.
  Result<void> Load(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid);

  // Draws all layers, and reads the resulting picture back into cells().
  Result<void> Merge(const CellBox& extent);

  const std::vector<Cell>& cells() const { return cells_; }

 private:
  class Context;
  explicit GlPainter(std::unique_ptr<Context> context);

  std::unique_ptr<Context> context_;
  std::vector<Cell> cells_;
};

}  // namespace moondb
