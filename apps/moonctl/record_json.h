// A stored record as commands show it in JSON.
#pragma once

#include "apps/common/json_writer.h"
#include "model/custom_types.h"
#include "proto/record.pb.h"

namespace moondb {

// Its key ("" for a local one), type, bytes, and `record`: protobuf's own JSON. Of a custom record the latest key and
// the payload stand there as text too, where they are text. `record`: its content.
void WriteRecord(const proto::StoredRecord& stored, const proto::Record& record, const CustomTypes& custom_types,
                 JsonWriter& json);

}  // namespace moondb
