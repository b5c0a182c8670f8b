// TypeSchema: a hash of an agent's schema of a data type. Peers compare their schemas before they share.
//
// The content of a record is stored and forwarded unchanged, including unknown fields. An agent that knows more fields
// of a type can therefore share it with others (docs/COMPATIBILITY.md). Schemas differ only if two agents use one type
// number for different types. An agent cannot store a built-in type that it does not know. A custom type that only one
// of two agents declares is still stored and forwarded by the other.
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

// Returns the types of `ours` that an agent with the schemas `theirs` would misunderstand or cannot store. Returns none
// if `theirs` is empty: an agent sends no schemas if its hash is equal.
std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs);

}  // namespace moondb
