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

// Returns a record whose body is the JSON object `json` of `type` ("temperature", {"celsius": 3}). The timestamp stays
// 0. kInvalid with protobuf's message, which names the field.
Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json);

// Like RecordFromJson, for a custom type: {"payload": BASE64, "latest_key": BASE64, "metadata": TEXT}. Each field is
// optional. "payload_text" and "latest_key_text" give the bytes as text instead.
Result<proto::Record> CustomRecordFromJson(const std::string& name, DataType type, const std::string& json);

}  // namespace moondb
