// TypeSchema: a hash of a data type's name. Peers compare their schemas before they share records, to detect a type
// number that stands for different types (docs/COMPATIBILITY.md).
//
// Agents that know different fields of a type still share its records: a record is stored and forwarded unchanged,
// including unknown fields. An agent cannot store a built-in type that it does not know. It stores and forwards custom
// types even if its team file does not declare them.
#pragma once

#include <cstdint>
#include <set>

#include "model/custom_types.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

using TypeSchemas = google::protobuf::RepeatedPtrField<proto::TypeSchema>;

// Returns the schemas of all built-in types, followed by the schemas of the custom types in the order of the team file.
TypeSchemas SchemasOf(const CustomTypes& custom_types);

// Returns one hash over all schemas, independent of their order. The hash is never 0.
std::uint64_t HashSchemas(const TypeSchemas& schemas);

// Returns the types of `ours` that an agent with the schemas `theirs` would misunderstand or cannot store. If `theirs`
// is empty, returns no types: an agent sends its schemas only if they differ from `ours`.
std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs);

}  // namespace moondb
