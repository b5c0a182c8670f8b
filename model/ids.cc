#include "model/ids.h"

#include <algorithm>
#include <cctype>

#include "proto/ids.pb.h"
#include "proto/role.pb.h"
#include "proto/types.pb.h"

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
    const auto& numbers = *proto::DataType_descriptor();
    for (int i = 0; i < numbers.value_count(); ++i) {
      if (const int number = numbers.value(i)->number(); number != 0) types.push_back(static_cast<DataType>(number));
    }
    std::sort(types.begin(), types.end());
    return types;
  }();
  return kTypes;
}

std::string RoleName(proto::Role role) {
  return role == proto::ROLE_UNSPECIFIED ? "none" : ToCase(proto::Role_Name(role).substr(5), std::tolower);
}

}  // namespace moondb
