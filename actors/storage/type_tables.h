// The SQL table of each built-in data type: the columns that the type adds to the columns of every table (schema.h),
// and the function that fills these columns from a record. Thread-safe.
//
// tests/actors/storage/type_tables_test.cc names each type whose entry is missing or wrong.
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
  std::string columns;  // SQL, such as "celsius REAL NOT NULL".
  // Binds the record's values of `columns`, in the same order.
  void (*bind)(const proto::Record& record, Query& query) = nullptr;
  // SQL condition that is true for rows about the nodes of agent ?6 (RecordTable::ReadInterval). Empty if the table's
  // rows are not about nodes.
  std::string agent_condition = {};
};

// Returns the tables in the order of the types' numbers.
const std::vector<TypeTable>& TypeTables();

// Returns the names of the columns in `columns`: {"celsius"} for "celsius REAL NOT NULL".
std::vector<std::string> ColumnNames(const std::string& columns);

}  // namespace moondb
