// GlPainter: the merger of the paper (Section 5.3), a painter's algorithm on OpenGL. It sorts layers by resolution and
// time, and draws them one after the other over the whole map, the best layer last. Each layer is a texture, unknown
// cells are discarded, and footprints are drawn on top.
//
// Needs an OpenGL driver. Places layers with floats, so cells at borders may differ from those of mergers with
// integers.
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
