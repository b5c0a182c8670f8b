// Records of local traversability maps without their cells, and whole again.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/grid.h"

namespace moondb {

// A map's record, apart.
struct SplitMap {
  std::string frame;             // The record's content, but with no cells in its layers.
  std::vector<MapLayer> layers;  // With cells. Their centres are not filled in.
};

// Nothing where the content is not a map, is larger than the map codec takes, or would not come back byte for byte from
// JoinMap with any version of the schema: fields that are unknown here, or a form that is not the canonical one.
std::optional<SplitMap> SplitMapRecord(std::string_view content);

// Of a frame: the sizes and resolutions of its layers, without cells. kCorrupt: it is no map, or too large.
Result<std::vector<MapLayer>> LayersOfFrame(std::string_view frame);

// The content. `layers` are those of the frame, with cells. kCorrupt as above.
Result<std::string> JoinMap(std::string_view frame, const std::vector<MapLayer>& layers);

}  // namespace moondb
