// The JSON form of a stored record in the output of commands.
#pragma once

#include <string>

#include "apps/common/json_writer.h"
#include "model/custom_types.h"
#include "proto/record.pb.h"

namespace moondb {

// Writes the record's key ("" for a local record), its type, its size in bytes, its time in UTC, and `record` as
// protobuf's JSON. For a custom record, also writes the latest key and the payload as text, each only if it is UTF-8.
// `record` is the decoded content of `stored`.
void WriteRecord(const proto::StoredRecord& stored, const proto::Record& record, const CustomTypes& custom_types,
                 JsonWriter& json);

// Returns the record's body as one line of at most about 60 bytes: `celsius: -40.5`.
std::string ValueText(const proto::Record& record);

}  // namespace moondb
