#include "bench/painted_layers.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

std::unique_ptr<PlacedThing> Placed(Result<std::unique_ptr<PlacedThing>> thing) {
  Check(thing.has_value(), "what is painted can be placed");
  return *std::move(thing);
}

}  // namespace

std::vector<Cell> UnpackCells(const PackedBlock& packed) {
  std::vector<Cell> cells;
  for (std::int32_t row = 0; row < packed.block().height; ++row) {
    for (std::int32_t column = 0; column < packed.block().width; ++column) cells.push_back(packed.At(column, row));
  }
  return cells;
}

std::vector<PaintedLayer> LayersToPaint(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                        const MergeGrid& grid) {
  std::vector<PaintedLayer> layers;
  for (const PlacedMap& map : maps) {
    const std::unique_ptr<PlacedThing> thing = Placed(PlaceMap(map, grid));
    for (const PlacedBlock& block : thing->blocks) {
      const PackedBlock& cells = *block.cells;
      layers.push_back({block.resolution_um, block.timestamp_ns, block.rectangle, cells.block().width,
                        cells.block().height, UnpackCells(cells)});
    }
  }
  std::stable_sort(layers.begin(), layers.end(), [](const PaintedLayer& a, const PaintedLayer& b) {
    return a.resolution_um != b.resolution_um ? a.resolution_um > b.resolution_um : a.timestamp_ns < b.timestamp_ns;
  });
  for (const Footprint& footprint : footprints) {
    const std::unique_ptr<PlacedThing> thing = Placed(PlaceFootprint(footprint, grid));
    for (const PlacedBlock& block : thing->blocks) {
      const PlacedRectangle& placed = block.rectangle;
      layers.push_back({0,
                        0,
                        placed,
                        static_cast<std::int32_t>(placed.width_q >> kFractionBits),
                        static_cast<std::int32_t>(placed.height_q >> kFractionBits),
                        {}});
    }
  }
  return layers;
}

}  // namespace moondb
