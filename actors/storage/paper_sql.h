// The paper's literal form of a record: one populated INSERT into the table of its data type (paper, Section 4). It is
// a baseline for comparison with the other codecs.
//
//   INSERT INTO temperature (record_id, agent_id, timestamp_ns, celsius) VALUES ('3.00061c40f0d7cf6b.1.17', 3, 17...,
//   -40.5)
//
// Each field that has a value has a column, whose name is the field's path within the record's body. Bytes, and the
// cells of a map at one byte each, are written as X'..'. A submessage whose fields have no values is written as 1.
//
// A peer's statement never runs in the store. It runs in an empty in-memory database that has only this one table. An
// authorizer permits only the insert: no function, no subquery, no further statement. SQLite's limits are lowered and
// its steps are bounded. The length of the text outside of quotes is limited. The statement must insert exactly one
// row, with the announced record_id and agent_id. The row is converted to a record, which is checked like any other
// record (record_validator.h).
//
// Thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "model/error.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

inline constexpr std::size_t kPaperSqlBytesMax = 8 * 1024 * 1024;

// Returns the INSERT statement for `record`. Returns null if the statement would be longer than kPaperSqlBytesMax, or
// if RecordOf would not return the same record. RecordOf cannot restore unknown fields, a body that is not of the key's
// type, more repeated values than the table has columns, or NaN.
std::optional<std::string> SqlOf(const proto::StoredRecord& record);

// Returns the record that the statement inserts. Fails with kCorrupt if the statement does not have the form that SqlOf
// writes, or if the row does not belong to `key`.
Result<proto::StoredRecord> RecordOf(std::string_view sql, const RecordKey& key);

}  // namespace moondb
