// The data types that a team declares for itself in its team file (`custom_types`), by id and by name.
//
// A type that is not declared has no name and no rules; its records are carried all the same (actors/storage). Pure
// functions, any thread.
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

// Null where none is declared.
const proto::CustomType* FindCustomType(const CustomTypes& types, DataType type);

// As in model/ids.h, and the declared types' names: "soil_moisture".
std::string DataTypeName(DataType type, const CustomTypes& types);
// Built-in or declared; "type_1007" for any custom id.
std::optional<DataType> DataTypeFromName(std::string_view name, const CustomTypes& types);

// Every name that DataTypeFromName knows, but for "type_1007" and its like: for suggestions.
std::vector<std::string> DataTypeNames(const CustomTypes& types);

// What model/record_check.h cannot know: kInvalid, with the field named as in "custom.payload", for a type that is not
// declared (the text lists those that are) and a payload that is longer than the type's bytes_max. For records that
// this team's own robots insert; CheckRecord comes first.
Result<void> CheckDeclared(const proto::CustomRecord& custom, const CustomTypes& types);

}  // namespace moondb
