#include "model/custom_types.h"

#include <algorithm>

#include "model/text.h"

namespace moondb {

namespace {

constexpr std::string_view kUnnamed = "type_";

std::string KnownTypes(const CustomTypes& types) {
  if (types.empty()) return "the team file declares no data type of its own";
  std::string text = "known are ";
  for (int i = 0; i < types.size(); ++i) {
    text += (i > 0 ? ", " : "") + types[i].name() + " (" + std::to_string(types[i].id()) + ")";
  }
  return text;
}

}  // namespace

const proto::CustomType* FindCustomType(const CustomTypes& types, DataType type) {
  const auto found = std::find_if(types.begin(), types.end(),
                                  [type](const proto::CustomType& declared) { return declared.id() == type; });
  return found == types.end() ? nullptr : &*found;
}

std::string DataTypeName(DataType type, const CustomTypes& types) {
  const proto::CustomType* declared = FindCustomType(types, type);
  return declared == nullptr ? DataTypeName(type) : declared->name();
}

std::optional<DataType> DataTypeFromName(std::string_view name, const CustomTypes& types) {
  if (const auto built_in = DataTypeFromName(name)) return built_in;
  const auto found = std::find_if(types.begin(), types.end(),
                                  [name](const proto::CustomType& declared) { return declared.name() == name; });
  if (found != types.end()) return found->id();
  if (!name.starts_with(kUnnamed)) return std::nullopt;
  const auto id = ParseUnsigned(name.substr(kUnnamed.size()));
  if (!id || *id > kCustomDataTypeMax || !IsCustom(static_cast<DataType>(*id))) return std::nullopt;
  return static_cast<DataType>(*id);
}

std::vector<std::string> DataTypeNames(const CustomTypes& types) {
  std::vector<std::string> names;
  for (const DataType type : BuiltInDataTypes()) names.push_back(DataTypeName(type));
  for (const proto::CustomType& type : types) names.push_back(type.name());
  return names;
}

Result<void> CheckDeclared(const proto::CustomRecord& custom, const CustomTypes& types) {
  const proto::CustomType* type = FindCustomType(types, custom.data_type());
  if (type == nullptr) {
    return Fail(ErrorCode::kInvalid, "no custom type " + std::to_string(custom.data_type()) + "; " + KnownTypes(types),
                "custom.data_type");
  }
  if (custom.payload().size() > type->bytes_max()) {
    return Fail(ErrorCode::kInvalid,
                "has " + std::to_string(custom.payload().size()) + " bytes; " + type->name() + " allows " +
                    std::to_string(type->bytes_max()),
                "custom.payload");
  }
  return {};
}

}  // namespace moondb
