// The table of each built-in data type, one row each: its columns beside those that every table has (schema.h), and how
// a record fills them.
//
// tests/actors/storage/type_tables_test.cc names the type whose row is missing or does not fit. Constants, any thread.
#pragma once

#include <string>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/ids.h"
#include "proto/record.pb.h"
#include "proto/types.pb.h"

namespace moondb {

struct TypeTable {
  DataType type = proto::DATA_TYPE_UNSPECIFIED;
  std::string columns;  // SQL: "celsius REAL NOT NULL".
  // Binds a record's values in the order of `columns`.
  void (*bind)(const proto::Record& record, Query& query) = nullptr;
  // SQL, true of rows about the nodes of agent ?6; empty where the table knows of none (RecordTable::ReadInterval).
  std::string agent_condition = {};
};

// In the order of the types' numbers.
const std::vector<TypeTable>& TypeTables();

// "celsius" of "celsius REAL NOT NULL".
std::vector<std::string> ColumnNames(const std::string& columns);

}  // namespace moondb
