// Messages as protobuf's own JSON, with the names of the .proto files and fields at their defaults too. Any thread.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

std::string ToJson(const google::protobuf::Message& message);

// A record whose body is the JSON object of `type` ("temperature", {"celsius": 3}); the stamp is left 0. kInvalid with
// protobuf's own words, which name the field.
Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json);

// The same for a custom type: {"payload": BASE64, "latest_key": BASE64, "metadata": TEXT}, each of which may be left
// out; "payload_text" and "latest_key_text" give the bytes as text instead.
Result<proto::Record> CustomRecordFromJson(const std::string& name, DataType type, const std::string& json);

}  // namespace moondb
