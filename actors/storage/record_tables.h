// RecordTable stores and finds records in one SQL table: the table of one built-in data type, or the table of all
// custom types.
//
// The columns other than `content` are derived from the content on insertion (schema.h). Functions that write run
// inside the caller's transaction. All functions fail as Database does.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "actors/storage/type_tables.h"
#include "model/data_types.h"
#include "model/have_set.h"
#include "model/ids.h"
#include "model/record_key.h"
#include "model/timestamp_range.h"
#include "proto/record.pb.h"

namespace moondb {

// Returns whether records of the type have a RecordVersion, as optimized poses and edge verdicts do.
bool IsVersioned(DataType type);

// Orders an origin's records of one type and latest key; the greatest record is the valid one. Versioned records
// compare by term and run first, so a record derived in a newer term wins even if its epoch is lower. All records then
// compare by epoch and seq.
struct RecordOrder {
  RecordVersion version;  // Zero for types that are not versioned.
  std::uint64_t epoch = 0;
  std::uint64_t seq = 0;
  auto operator<=>(const RecordOrder&) const = default;
};
RecordOrder OrderOf(const RecordKey& key, const proto::Record& record);

class RecordTable {
 public:
  // For one built-in type, or for all custom types if `table` is null. `table` must outlive this object.
  explicit RecordTable(const TypeTable* table);

  bool Holds(DataType type) const { return type_ == 0 ? IsCustom(type) : type == type_; }
  const std::string& name() const { return name_; }

  // Inserts a row. The row is local (not shared) if `key.seq` is 0. Requires: `content` is the serialised `record`.
  Result<void> Insert(Database& database, std::uint64_t row_id, const RecordKey& key, const proto::Record& record,
                      std::string_view content, std::uint64_t hash) const;
  Result<void> Delete(Database& database, std::uint64_t row_id) const;

  struct Row {
    std::uint64_t row_id = 0;
    RecordKey key;  // seq 0 if the row is not shared.
    std::uint64_t hash = 0;
    std::string latest_key;
    std::uint64_t content_bytes = 0;
    RecordVersion version;

    RecordOrder order() const { return {version, key.stream.epoch, key.seq}; }
  };
  Result<std::optional<Row>> Find(Database& database, const RecordKey& key) const;
  // Returns the states (Record.is_state) of one origin, type and latest key, shared or not.
  Result<std::vector<Row>> FindStates(Database& database, AgentId origin, DataType type,
                                      std::string_view latest_key) const;
  // For each latest key of one origin and type, finds the shared record that is the greatest by RecordOrder. Returns
  // the seqs of these records, by epoch.
  Result<std::map<std::uint64_t, IntervalSet>> FindNewest(Database& database, AgentId origin, DataType type) const;
  Result<std::vector<Row>> FindInInterval(Database& database, const StreamKey& stream, std::uint64_t first,
                                          std::uint64_t last) const;
  // Key and content of a row. FindByNaturalKey returns the first row with `natural_key`; null if there is none.
  struct Named {
    RecordKey key;
    std::string content;
  };
  Result<std::optional<Named>> FindByNaturalKey(Database& database, AgentId origin, DataType type,
                                                std::string_view natural_key) const;

  // Reads rows with the columns 0 row_id, 1 origin, 2 epoch, 3 seq, 4 hash, 5 content, 6 data type. If `agent` is not
  // 0, tables with a TypeTable::agent_condition return only rows about the nodes of `agent`.
  Query ReadInterval(Database& database, const StreamKey& stream, std::uint64_t first, std::uint64_t last,
                     AgentId agent) const;
  Result<std::uint64_t> CountInterval(Database& database, const StreamKey& stream, std::uint64_t first,
                                      std::uint64_t last, AgentId agent) const;
  // Reads rows with the columns 0 row_id, 1 seq, 2 timestamp_ns, 3 length of the content in bytes. Does not read
  // contents.
  Query ReadHeads(Database& database, const StreamKey& stream, std::uint64_t first, std::uint64_t last) const;
  // Fails with kNotFound if there is no such row.
  Result<proto::Record> ReadRecord(Database& database, std::uint64_t row_id) const;
  // Count and bytes of an origin's rows, shared or not. SizesByOrigin scans the table, but reads no contents.
  struct Size {
    std::uint64_t row_count = 0;
    std::uint64_t content_bytes = 0;
  };
  Result<std::map<AgentId, Size>> SizesByOrigin(Database& database) const;
  // ReadAfter reads the rows after `row_id` in rising order. ReadNewestFirst reads all rows, the newest first. The
  // columns of both queries are those of ReadInterval.
  Query ReadAfter(Database& database, std::uint64_t row_id) const;
  Query ReadNewestFirst(Database& database) const;
  // As ReadAfter, or ReadNewestFirst if `is_newest_first`, for timestamps within `times`.
  Result<Query> ReadInTimes(Database& database, const TimestampRange& times, std::uint64_t row_id,
                            bool is_newest_first) const;
  // Returns the number of an origin's rows that are not shared, by data type.
  Result<std::map<DataType, std::uint64_t>> CountNotShared(Database& database, AgentId origin) const;

  // SQL that copies the row with the bound row id into the table `history`. The row's typed columns are written as
  // JSON.
  const std::string& copy_to_history() const { return sql_.copy_to_history; }

  bool knows_agent() const { return table_ != nullptr && !table_->agent_condition.empty(); }

  // Returns the current row of ReadInterval, ReadAfter or ReadNewestFirst as a record.
  static proto::StoredRecord Read(const Query& query);

 private:
  struct Sql {
    std::string insert, remove, find, find_by_latest_key, find_newest, find_in_interval, find_by_natural_key;
    std::string read_interval, count_interval, read_interval_of_agent, count_interval_of_agent;
    std::string read, read_after, read_newest_first, count_in_times, count_not_shared, read_heads, read_record,
        read_sizes;
    std::string copy_to_history;
  };

  // `type` is a SQL expression for a row's data type.
  void MakeSql(const std::string& type, const std::vector<std::string>& columns);
  void BindLatestKey(std::string_view latest_key, Query& query) const;
  Result<std::vector<Row>> ReadRows(Query query) const;

  const TypeTable* table_;
  DataType type_;  // 0 for the table of all custom types.
  std::string name_;
  Sql sql_;
};

// Returns the tables of the built-in types in the order of their numbers, then the table of custom types.
const std::vector<RecordTable>& RecordTables();

// Returns null if the type has no table.
const RecordTable* FindRecordTable(DataType type);

}  // namespace moondb
