// Splits the record of a local traversability map into its cells and the remaining content, and joins both again.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/grid.h"

namespace moondb {

// A map's record, split into its layers and the remaining content.
struct SplitMap {
  std::string frame;             // The record's content without the cells of its layers.
  std::vector<MapLayer> layers;  // The layers with cells, but without centres.
};

// Splits a map's record. Returns nullopt if the content is not a map, or if the map is too large for the map codec.
// Also returns nullopt if JoinMap could not restore the same bytes, because the record has unknown fields or is not in
// canonical form.
std::optional<SplitMap> SplitMapRecord(std::string_view content);

// Returns the layers of a frame with sizes and resolutions, without cells. Returns kCorrupt if the frame is not a map,
// or if the map is too large.
Result<std::vector<MapLayer>> LayersOfFrame(std::string_view frame);

// Returns the content of the map's record. `layers` are the layers of the frame, with cells. Returns kCorrupt if the
// frame is not a map with the same number of layers.
Result<std::string> JoinMap(std::string_view frame, const std::vector<MapLayer>& layers);

}  // namespace moondb
