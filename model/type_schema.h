// TypeSchema: a hash of the schema that an agent has for a data type. Peers compare their schemas before they share
// records.
//
// The content of a record is stored and forwarded unchanged, including unknown fields. An agent that knows more fields
// of a type can therefore share its records with others (docs/COMPATIBILITY.md). Schemas differ only if two agents use
// one type number for different types. An agent cannot store a built-in type that it does not know. If only one of two
// agents declares a custom type, the other agent still stores and forwards its records.
#pragma once

#include <cstdint>
#include <set>

#include "model/custom_types.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

using TypeSchemas = google::protobuf::RepeatedPtrField<proto::TypeSchema>;

// Returns the schemas of all built-in types, then those of the custom types in the order of the team file.
TypeSchemas SchemasOf(const CustomTypes& custom_types);

// Returns one hash over all schemas, independent of their order. Never 0.
std::uint64_t HashSchemas(const TypeSchemas& schemas);

// Returns the types of `ours` that an agent with the schemas `theirs` would misunderstand or cannot store. Returns no
// types if `theirs` is empty, because an agent sends no schemas if its HashSchemas equals ours.
std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs);

}  // namespace moondb
