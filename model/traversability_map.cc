#include "model/traversability_map.h"

#include <cmath>
#include <string>

namespace moondb {

namespace {

constexpr double kLayerOffsetMax_m = 1e6;

Result<MapLayer> FromProto(const proto::MapLayer& layer, const std::string& field) {
  if (layer.width_cells() < 1 || layer.width_cells() > kMapSideCellsMax) {
    return Fail(ErrorCode::kInvalid, "must be 1 to " + std::to_string(kMapSideCellsMax), field + ".width_cells");
  }
  if (layer.height_cells() < 1 || layer.height_cells() > kMapSideCellsMax) {
    return Fail(ErrorCode::kInvalid, "must be 1 to " + std::to_string(kMapSideCellsMax), field + ".height_cells");
  }
  if (layer.resolution_um() < 1 || layer.resolution_um() > kMapResolutionUmMax) {
    return Fail(ErrorCode::kInvalid, "must be 1 to " + std::to_string(kMapResolutionUmMax), field + ".resolution_um");
  }
  if (!(std::abs(layer.center_x_m()) <= kLayerOffsetMax_m) || !(std::abs(layer.center_y_m()) <= kLayerOffsetMax_m)) {
    return Fail(ErrorCode::kInvalid, "is not finite or beyond 1e6 m", field + ".center_m");
  }
  Result<Grid> grid = UnpackCells(static_cast<std::int32_t>(layer.width_cells()),
                                  static_cast<std::int32_t>(layer.height_cells()), layer.cells());
  if (!grid) return Fail(grid.error().code, grid.error().text, field + ".cells");
  return MapLayer{*std::move(grid), layer.resolution_um(), layer.center_x_m(), layer.center_y_m()};
}

}  // namespace

Eigen::Vector2d CornerOf(const MapLayer& layer) {
  return {layer.center_x_m - layer.resolution_m() * layer.grid.width / 2,
          layer.center_y_m - layer.resolution_m() * layer.grid.height / 2};
}

proto::LocalTraversabilityMap ToProto(const TraversabilityMap& map) {
  proto::LocalTraversabilityMap result;
  *result.mutable_node() = ToProto(map.node);
  *result.mutable_node_from_map() = ToProto(map.node_from_map);
  for (const MapLayer& layer : map.layers) {
    proto::MapLayer& added = *result.add_layers();
    added.set_width_cells(static_cast<std::uint32_t>(layer.grid.width));
    added.set_height_cells(static_cast<std::uint32_t>(layer.grid.height));
    added.set_resolution_um(layer.resolution_um);
    added.set_center_x_m(layer.center_x_m);
    added.set_center_y_m(layer.center_y_m);
    added.set_cells(PackCells(layer.grid));
  }
  return result;
}

Result<TraversabilityMap> FromProto(const proto::LocalTraversabilityMap& map) {
  if (map.node().agent_id() < 1 || map.node().agent_id() > kAgentIdMax) {
    return Fail(ErrorCode::kInvalid, "is not an agent id", "node.agent_id");
  }
  const Result<Pose> node_from_map = FromProto(map.node_from_map());
  if (!node_from_map) {
    return Fail(node_from_map.error().code, node_from_map.error().text, "node_from_map." + node_from_map.error().field);
  }
  if (map.layers_size() < 1 || map.layers_size() > kMapLayersMax) {
    return Fail(ErrorCode::kInvalid, "must be 1 to " + std::to_string(kMapLayersMax), "layers");
  }
  TraversabilityMap result{FromProto(map.node()), *node_from_map, {}};
  std::uint64_t cell_count = 0;
  for (int i = 0; i < map.layers_size(); ++i) {
    const std::string field = "layers[" + std::to_string(i) + "]";
    cell_count += static_cast<std::uint64_t>(map.layers(i).width_cells()) * map.layers(i).height_cells();
    if (cell_count > kMapCellsMax) return Fail(ErrorCode::kInvalid, "has too many cells", field);
    Result<MapLayer> layer = FromProto(map.layers(i), field);
    if (!layer) return tl::unexpected(layer.error());
    if (i > 0 && layer->resolution_um < result.layers.back().resolution_um) {
      return Fail(ErrorCode::kInvalid, "is finer than the layer before it", field + ".resolution_um");
    }
    result.layers.push_back(*std::move(layer));
  }
  return result;
}

}  // namespace moondb
