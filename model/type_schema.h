// TypeSchema: what an agent understands by a data type, as a hash that peers compare before they share.
//
// A record's content is kept and passed on as its origin wrote it, fields unknown here included: so an agent that knows
// more fields of a type shares it with the others (docs/COMPATIBILITY.md). What differs is a type's number under which
// two agents name two things. A built-in type that an agent does not know it cannot keep; a custom one that is declared
// at one of two agents only, the other carries.
#pragma once

#include <cstdint>
#include <set>

#include "model/custom_types.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

using TypeSchemas = google::protobuf::RepeatedPtrField<proto::TypeSchema>;

// All built-in types, then the custom ones in the order of the team file.
TypeSchemas SchemasOf(const CustomTypes& custom_types);

// One hash over all of them, in any order; never 0.
std::uint64_t HashSchemas(const TypeSchemas& schemas);

// The types of `ours` that an agent with the schemas `theirs` would misunderstand or cannot keep. None where it told no
// schemas, as its hash is the same.
std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs);

}  // namespace moondb
