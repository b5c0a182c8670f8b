#include "model/traversability_map.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "model/check.h"

namespace moondb {

namespace {

constexpr std::size_t kCellsPerByte = 4;
constexpr double kLayerOffsetMax_m = 1e6;

std::size_t PackedSize(std::size_t cell_count) { return (cell_count + kCellsPerByte - 1) / kCellsPerByte; }

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

Grid::Grid(std::int32_t w, std::int32_t h, Cell fill)
    : width(w), height(h), cells(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {
  Check(w >= 0 && h >= 0, "a grid's sides are not negative");
}

MergedMap CroppedToKnown(const MergedMap& map, std::int32_t margin_cells) {
  std::int32_t left = map.grid.width, right = -1, bottom = map.grid.height, top = -1;
  for (std::int32_t row = 0; row < map.grid.height; ++row) {
    for (std::int32_t column = 0; column < map.grid.width; ++column) {
      if (map.grid.At(column, row) == Cell::kUnknown) continue;
      left = std::min(left, column);
      right = std::max(right, column);
      bottom = std::min(bottom, row);
      top = std::max(top, row);
    }
  }
  if (right < 0) return map;
  left = std::max(0, left - margin_cells);
  bottom = std::max(0, bottom - margin_cells);
  right = std::min(map.grid.width - 1, right + margin_cells);
  top = std::min(map.grid.height - 1, top + margin_cells);
  MergedMap part{Grid(right - left + 1, top - bottom + 1), map.resolution_um, map.origin_cell_x + left,
                 map.origin_cell_y + bottom};
  for (std::int32_t row = bottom; row <= top; ++row) {
    for (std::int32_t column = left; column <= right; ++column) {
      part.grid.At(column - left, row - bottom) = map.grid.At(column, row);
    }
  }
  return part;
}

std::string PackCells(const Grid& grid) {
  std::string bytes(PackedSize(grid.cells.size()), '\0');
  for (std::size_t i = 0; i < grid.cells.size(); ++i) {
    const auto shift = 2 * (i % kCellsPerByte);
    bytes[i / kCellsPerByte] = static_cast<char>(bytes[i / kCellsPerByte] | (static_cast<int>(grid.cells[i]) << shift));
  }
  return bytes;
}

Result<Grid> UnpackCells(std::int32_t width, std::int32_t height, std::string_view bytes) {
  if (width < 0 || height < 0) return Fail(ErrorCode::kInvalid, "has a negative side");
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (bytes.size() != PackedSize(count)) {
    return Fail(ErrorCode::kInvalid, "has " + std::to_string(bytes.size()) + " bytes, but " + std::to_string(width) +
                                         " x " + std::to_string(height) + " cells need " +
                                         std::to_string(PackedSize(count)));
  }
  Grid grid(width, height);
  for (std::size_t i = 0; i < count; ++i) {
    const int value = (static_cast<unsigned char>(bytes[i / kCellsPerByte]) >> (2 * (i % kCellsPerByte))) & 3;
    if (value == 3) return Fail(ErrorCode::kInvalid, "cell " + std::to_string(i) + " has the value 3");
    grid.cells[i] = static_cast<Cell>(value);
  }
  const std::size_t used = count % kCellsPerByte;
  if (used != 0 && static_cast<unsigned char>(bytes.back()) >> (2 * used) != 0) {
    return Fail(ErrorCode::kInvalid, "has bits set behind its last cell");
  }
  return grid;
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
    return Fail(ErrorCode::kInvalid, "is no agent id", "node.agent_id");
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
