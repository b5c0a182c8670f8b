// Converts messages to and from protobuf's JSON. Field names are those of the .proto files; fields with default values
// are written too. Thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

std::string ToJson(const google::protobuf::Message& message);

// Returns a record of the data type `type` with the body `json`, for example "temperature" and {"celsius": 3}. The
// timestamp is 0. Returns kInvalid if `json` is not an object or does not fit the type. The error text names a field
// that the type lacks and lists the type's fields.
Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json);

// Like RecordFromJson, for the custom type `name` with the id `type`. `json` is {"payload": BASE64, "latest_key":
// BASE64, "metadata": TEXT}. Each field is optional. "payload_text" and "latest_key_text" hold the bytes as text
// instead of base64.
Result<proto::Record> CustomRecordFromJson(const std::string& name, DataType type, const std::string& json);

}  // namespace moondb
