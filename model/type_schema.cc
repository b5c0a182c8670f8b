#include "model/type_schema.h"

#include <xxhash.h>

#include <map>
#include <string>

namespace moondb {
namespace {

void Add(DataType type, const std::string& name, TypeSchemas& schemas) {
  proto::TypeSchema& schema = *schemas.Add();
  schema.set_data_type(type);
  schema.set_hash(static_cast<std::uint32_t>(XXH64(name.data(), name.size(), 0)));
}

}  // namespace

TypeSchemas SchemasOf(const CustomTypes& custom_types) {
  TypeSchemas schemas;
  for (const DataType type : BuiltInDataTypes()) Add(type, DataTypeName(type), schemas);
  for (const proto::CustomType& type : custom_types) Add(type.id(), type.name(), schemas);
  return schemas;
}

std::uint64_t HashSchemas(const TypeSchemas& schemas) {
  std::uint64_t sum = 0;
  for (const proto::TypeSchema& schema : schemas) {
    const std::string text = std::to_string(schema.data_type()) + " " + std::to_string(schema.hash());
    sum += XXH64(text.data(), text.size(), 0);
  }
  return sum == 0 ? 1 : sum;
}

std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs) {
  if (theirs.empty()) return {};
  std::map<DataType, std::uint32_t> their_hash;
  for (const proto::TypeSchema& schema : theirs) their_hash[schema.data_type()] = schema.hash();
  std::set<DataType> types;
  for (const proto::TypeSchema& schema : ours) {
    const auto found = their_hash.find(schema.data_type());
    const bool is_known = found != their_hash.end();
    if (is_known ? found->second != schema.hash() : !IsCustom(schema.data_type())) types.insert(schema.data_type());
  }
  return types;
}

}  // namespace moondb
