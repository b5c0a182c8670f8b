#include "actors/sharing/coding/map_record.h"

#include <google/protobuf/message.h>

#include "actors/sharing/coding/map_codec.h"
#include "model/bounded_parse.h"
#include "proto/record.pb.h"

namespace moondb {

namespace {

bool HasUnknownFields(const google::protobuf::Message& message) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  if (!reflection.GetUnknownFields(message).empty()) return true;
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    if (field->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) continue;
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (HasUnknownFields(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                                : reflection.GetMessage(message, field))) {
        return true;
      }
    }
  }
  return false;
}

bool ParseMap(std::string_view content, proto::Record& record) {
  return ParseBounded(content, &record) && record.has_local_traversability_map();
}

// Returns the layers' sizes and resolutions, without cells; nullopt if the map codec cannot code such layers.
std::optional<std::vector<MapLayer>> ShapeOf(const proto::LocalTraversabilityMap& map) {
  if (map.layers_size() > kMapLayersMax) return std::nullopt;
  std::vector<MapLayer> layers;
  for (const proto::MapLayer& layer : map.layers()) {
    constexpr std::uint32_t kSideMax = static_cast<std::uint32_t>(kCodedMapSideMax);
    if (layer.width_cells() > kSideMax || layer.height_cells() > kSideMax) return std::nullopt;
    MapLayer& added = layers.emplace_back();
    added.grid.width = static_cast<std::int32_t>(layer.width_cells());
    added.grid.height = static_cast<std::int32_t>(layer.height_cells());
    added.resolution_um = layer.resolution_um();
  }
  if (!IsCodable(layers)) return std::nullopt;
  return layers;
}

}  // namespace

std::optional<SplitMap> SplitMapRecord(std::string_view content) {
  proto::Record record;
  if (!ParseMap(content, record) || HasUnknownFields(record)) return std::nullopt;
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  std::optional<std::vector<MapLayer>> layers = ShapeOf(map);
  if (!layers) return std::nullopt;
  for (int i = 0; i < map.layers_size(); ++i) {
    Grid& grid = (*layers)[static_cast<std::size_t>(i)].grid;
    Result<Grid> cells = UnpackCells(grid.width, grid.height, map.layers(i).cells());
    if (!cells) return std::nullopt;
    grid = *std::move(cells);
    map.mutable_layers(i)->clear_cells();
  }
  SplitMap split{record.SerializeAsString(), *std::move(layers)};
  const Result<std::string> joined = JoinMap(split.frame, split.layers);
  if (!joined || *joined != content) return std::nullopt;
  return split;
}

Result<std::vector<MapLayer>> LayersOfFrame(std::string_view frame) {
  proto::Record record;
  if (!ParseMap(frame, record)) return Fail(ErrorCode::kCorrupt, "is not a map", "coded");
  std::optional<std::vector<MapLayer>> layers = ShapeOf(record.local_traversability_map());
  if (!layers) return Fail(ErrorCode::kCorrupt, "is larger than a coded map may be", "coded");
  return *std::move(layers);
}

Result<std::string> JoinMap(std::string_view frame, const std::vector<MapLayer>& layers) {
  proto::Record record;
  if (!ParseMap(frame, record) ||
      static_cast<std::size_t>(record.local_traversability_map().layers_size()) != layers.size()) {
    return Fail(ErrorCode::kCorrupt, "does not hold the map layers that its batch states", "coded");
  }
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  for (int i = 0; i < map.layers_size(); ++i) {
    map.mutable_layers(i)->set_cells(PackCells(layers[static_cast<std::size_t>(i)].grid));
  }
  return record.SerializeAsString();
}

}  // namespace moondb
