#include "model/ids.h"

#include <algorithm>
#include <cctype>

namespace moondb {

namespace {

std::string ToCase(std::string text, int (*convert)(int)) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [convert](unsigned char c) { return static_cast<char>(convert(c)); });
  return text;
}

}  // namespace

NodeKey FromProto(const proto::NodeKey& node) { return NodeKey{node.agent_id(), node.index()}; }

proto::NodeKey ToProto(const NodeKey& node) {
  proto::NodeKey result;
  result.set_agent_id(node.agent);
  result.set_index(node.index);
  return result;
}

std::string DataTypeName(DataType type) {
  if (type == 0 || !proto::DataType_IsValid(static_cast<int>(type))) return "type_" + std::to_string(type);
  return ToCase(proto::DataType_Name(static_cast<proto::DataType>(type)), std::tolower);
}

std::optional<DataType> DataTypeFromName(std::string_view name) {
  proto::DataType type = proto::DATA_TYPE_UNSPECIFIED;
  const std::string upper = ToCase(std::string(name), std::toupper);
  if (!proto::DataType_Parse(upper, &type) || type == proto::DATA_TYPE_UNSPECIFIED) return std::nullopt;
  return static_cast<DataType>(type);
}

const std::vector<DataType>& BuiltInDataTypes() {
  static const std::vector<DataType> kTypes = [] {
    std::vector<DataType> types;
    const auto* known = proto::DataType_descriptor();
    for (int i = 0; i < known->value_count(); ++i) {
      if (known->value(i)->number() != 0) types.push_back(static_cast<DataType>(known->value(i)->number()));
    }
    std::sort(types.begin(), types.end());
    return types;
  }();
  return kTypes;
}

int SharingRank(DataType type) {
  if (type < proto::POSE_GRAPH_NODE) return 0;
  switch (type) {
    case proto::POSE_GRAPH_NODE:
      return 1;
    case proto::POSE_GRAPH_EDGE:
      return 2;
    case proto::OPTIMIZED_POSE:
    case proto::EDGE_VERDICT:
    case proto::MAP_QUARANTINE:
      return 3;
    case proto::LOCAL_TRAVERSABILITY_MAP:
      return 5;
    default:
      return 4;
  }
}

std::string RoleName(proto::Role role) {
  return role == proto::ROLE_UNSPECIFIED ? "none" : ToCase(proto::Role_Name(role).substr(5), std::tolower);
}

}  // namespace moondb
