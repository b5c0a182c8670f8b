// Local traversability maps, and their conversion from and to records (proto/record.proto, LocalTraversabilityMap).
#pragma once

#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/grid.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

struct TraversabilityMap {
  NodeKey node;
  Pose node_from_map;
  std::vector<MapLayer> layers;  // Sorted by resolution, finest first.
};

// Returns the lower left corner of the layer's cell (0, 0) in the frame of the map, in metres.
Eigen::Vector2d CornerOf(const MapLayer& layer);

proto::LocalTraversabilityMap ToProto(const TraversabilityMap& map);

// Validates and converts a map from a message. Fails with kInvalid and the field ("layers[1].cells") for an invalid
// agent id or pose, or if a size or number is 0 or exceeds its limit in model/grid.h. Also fails with kInvalid if a
// layer is finer than the previous layer, its centre is beyond 1e6 m, or UnpackCells rejects its cells.
Result<TraversabilityMap> FromProto(const proto::LocalTraversabilityMap& map);

}  // namespace moondb
