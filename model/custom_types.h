// Lookup of the data types that a team declares in its team file (`custom_types`), by id and by name.
//
// A custom type that the team file does not declare has no name and no rules, but its records are still stored and
// shared (actors/storage). Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

using CustomTypes = google::protobuf::RepeatedPtrField<proto::CustomType>;

// Returns the declaration of this type; null if the team does not declare it.
const proto::CustomType* FindCustomType(const CustomTypes& types, DataType type);

// Like DataTypeName in model/ids.h, but also knows the names of declared types: "soil_moisture".
std::string DataTypeName(DataType type, const CustomTypes& types);
// Returns the built-in or declared type of this name; nullopt if there is none. Accepts "type_1007" for any custom id.
std::optional<DataType> DataTypeFromName(std::string_view name, const CustomTypes& types);

// Returns all names that DataTypeFromName accepts, except those like "type_1007". Used for suggestions.
std::vector<std::string> DataTypeNames(const CustomTypes& types);

// Checks a custom record against the declared types. Use it for records that the agent's own robot inserts, after
// CheckRecord (model/record_check.h). Fails with kInvalid and the field ("custom.payload") if the type is not declared
// or the payload exceeds the type's bytes_max. The error text lists the declared types.
Result<void> CheckDeclared(const proto::CustomRecord& custom, const CustomTypes& types);

}  // namespace moondb
