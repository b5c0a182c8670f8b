// Local traversability maps, and their form in records (proto/record.proto, LocalTraversabilityMap).
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
  std::vector<MapLayer> layers;  // Finest first.
};

proto::LocalTraversabilityMap ToProto(const TraversabilityMap& map);

// Checks every field; kInvalid with the field named ("layers[1].cells").
Result<TraversabilityMap> FromProto(const proto::LocalTraversabilityMap& map);

}  // namespace moondb
