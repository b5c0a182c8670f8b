// TypeSchema: what an agent understands by a data type, as a hash that peers compare before they share.
//
// A record's content is kept and passed on as its origin wrote it, fields unknown here included: so a newer agent that
// only adds fields to a type shares it with older ones. What differs is a type whose fields changed their meaning
// (kRecordFormat), and a custom type's id under which two team files name two things. A built-in type that an older
// agent does not know it cannot keep; a custom one that is declared at one of two agents only, the other carries.
#pragma once

#include <cstdint>
#include <set>

#include "model/custom_types.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

// Of all built-in types; raised when a field of any of them comes to mean something else.
inline constexpr int kRecordFormat = 1;

using TypeSchemas = google::protobuf::RepeatedPtrField<proto::TypeSchema>;

// All built-in types, then the custom ones in the order of the team file.
TypeSchemas SchemasOf(const CustomTypes& custom_types);

// One hash over all of them, in any order; never 0.
std::uint64_t HashSchemas(const TypeSchemas& schemas);

// The types of `ours` that an agent with the schemas `theirs` would misunderstand or cannot keep. None where it told no
// schemas, as its hash is the same.
std::set<DataType> TypesNotFor(const TypeSchemas& ours, const TypeSchemas& theirs);

}  // namespace moondb
