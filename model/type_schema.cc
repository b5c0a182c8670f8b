#include "model/type_schema.h"

#include <xxhash.h>

#include <map>
#include <string>

namespace moondb {
namespace {

void Add(DataType type, const std::string& meaning, TypeSchemas& schemas) {
  proto::TypeSchema& schema = *schemas.Add();
  schema.set_data_type(type);
  schema.set_hash(static_cast<std::uint32_t>(XXH64(meaning.data(), meaning.size(), 0)));
}

}  // namespace

TypeSchemas SchemasOf(const CustomTypes& custom_types) {
  TypeSchemas schemas;
  for (const DataType type : BuiltInDataTypes()) {
    Add(type, DataTypeName(type) + " " + std::to_string(kRecordFormat), schemas);
  }
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

std::set<DataType> DifferingTypes(const TypeSchemas& a, const TypeSchemas& b) {
  std::map<DataType, std::uint32_t> hash_in_a;
  for (const proto::TypeSchema& schema : a) hash_in_a[schema.data_type()] = schema.hash();
  std::set<DataType> differing;
  for (const proto::TypeSchema& schema : b) {
    const auto found = hash_in_a.find(schema.data_type());
    if (found != hash_in_a.end() && found->second != schema.hash()) differing.insert(schema.data_type());
  }
  return differing;
}

}  // namespace moondb
