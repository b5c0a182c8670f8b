// The paper's literal form of a record: one populated INSERT into the table of its data type (paper, Section 4), to
// compare other codecs with.
//
//   INSERT INTO temperature (record_id, agent_id, timestamp_ns, celsius) VALUES ('3.00061c40f0d7cf6b.1.17', 3, 17...,
//   -40.5)
//
// A column for each field that has a value, named by its path within the record's body; bytes and a map's cells, one
// byte each, as X'..'. A message without any field that has a value is 1.
//
// A peer's statement never comes near the store: it is run in an empty database of its own in memory that has this one
// table, under an authorizer that lets it insert there and nothing else (no function, no subquery, no other statement
// behind it), with SQLite's limits lowered, so many steps, and no more outside of quotes than its table's columns need;
// and it must have made exactly one row, with the announced record_id and agent_id. What that row holds becomes a
// record, to be checked like any other (record_validator.h).
// Pure functions, safe from any thread.
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

// Nothing where RecordOf would not give the same record back: fields that are unknown here, a body that is not of the
// key's type, more repeated values than a table has columns for, NaN, a larger statement than kPaperSqlBytesMax.
std::optional<std::string> SqlOf(const proto::StoredRecord& record);

// kCorrupt: the statement is not one that SqlOf makes, or makes another row than that of `key`.
Result<proto::StoredRecord> RecordOf(std::string_view sql, const RecordKey& key);

}  // namespace moondb
