// RecordTable: where the records of one data type, or of all custom ones, lie, and the SQL that stores and finds them
// there.
//
// Columns beside `content` are derived from it on the way in (schema.h). All functions run inside the caller's
// transaction where they write, and fail as Database does.
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
#include "proto/record.pb.h"

namespace moondb {

// Whether a type's records have a RecordVersion, as optimized poses and edge verdicts do.
bool IsVersioned(DataType type);

// Which of an origin's records of one type and latest key stands: the greatest. Versioned ones go by term and run, so
// that what a leader derived in a newer term stands whatever the epoch; then, as all others, by epoch and seq.
struct RecordOrder {
  RecordVersion version;  // Zeros for types that are not versioned.
  std::uint64_t epoch = 0;
  std::uint64_t seq = 0;
  auto operator<=>(const RecordOrder&) const = default;
};
RecordOrder OrderOf(const RecordKey& key, const proto::Record& record);

class RecordTable {
 public:
  // Of one built-in type; null: of all custom types. The row outlives this.
  explicit RecordTable(const TypeTable* table);

  bool Holds(DataType type) const { return type_ == 0 ? IsCustom(type) : type == type_; }
  const std::string& name() const { return name_; }

  // `key.seq` 0 makes a row that is not shared. `content` is the serialised `record`.
  Result<void> Insert(Database& database, std::uint64_t row_id, const RecordKey& key, const proto::Record& record,
                      std::string_view content, std::uint64_t hash) const;
  Result<void> Delete(Database& database, std::uint64_t row_id) const;

  struct Row {
    std::uint64_t row_id = 0;
    RecordKey key;  // seq 0: not shared.
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
  // The shared records of one origin and type that are each the greatest of their latest key (RecordOrder), by epoch.
  Result<std::map<std::uint64_t, IntervalSet>> FindNewest(Database& database, AgentId origin, DataType type) const;
  Result<std::vector<Row>> FindInInterval(Database& database, const StreamKey& stream, std::uint64_t first,
                                          std::uint64_t last) const;
  // The content of the first row under a natural key.
  struct Named {
    RecordKey key;
    std::string content;
  };
  Result<std::optional<Named>> FindByNaturalKey(Database& database, AgentId origin, DataType type,
                                                std::string_view natural_key) const;

  // Columns 0 row_id, 1 origin, 2 epoch, 3 seq, 4 hash, 5 content, 6 data type. `agent` not 0: rows about this agent's
  // nodes only, in the tables that know a node's agent by TypeTable::agent_condition.
  Query ReadInterval(Database& database, const StreamKey& stream, std::uint64_t first, std::uint64_t last,
                     AgentId agent) const;
  Result<std::uint64_t> CountInterval(Database& database, const StreamKey& stream, std::uint64_t first,
                                      std::uint64_t last, AgentId agent) const;
  // Columns 0 row_id, 1 seq, 2 timestamp_ns, 3 the content's bytes; the contents themselves are not read.
  Query ReadHeads(Database& database, const StreamKey& stream, std::uint64_t first, std::uint64_t last) const;
  // kNotFound where there is none.
  Result<proto::Record> ReadRecord(Database& database, std::uint64_t row_id) const;
  // All rows, shared or not, by origin. Reads no contents, but goes through the table.
  struct Size {
    std::uint64_t row_count = 0;
    std::uint64_t content_bytes = 0;
  };
  Result<std::map<AgentId, Size>> SizesByOrigin(Database& database) const;
  // All rows: after `row_id` with rising row_id, or from the newest down.
  Query ReadAfter(Database& database, std::uint64_t row_id) const;
  Query ReadNewestFirst(Database& database) const;
  // By data type.
  Result<std::map<DataType, std::uint64_t>> CountNotShared(Database& database, AgentId origin) const;

  // SQL that copies the row of one row id into the table `history`, with the typed columns as JSON.
  const std::string& copy_to_history() const { return sql_.copy_to_history; }

  bool knows_agent() const { return table_ != nullptr && !table_->agent_condition.empty(); }

  // A record as ReadInterval, ReadAfter and ReadNewestFirst give it.
  static proto::StoredRecord Read(const Query& query);

 private:
  struct Sql {
    std::string insert, remove, find, find_by_latest_key, find_newest, find_in_interval, find_by_natural_key;
    std::string read_interval, count_interval, read_interval_of_agent, count_interval_of_agent;
    std::string read_after, read_newest_first, count_not_shared, read_heads, read_record, read_sizes;
    std::string copy_to_history;
  };

  // `type` is SQL for a row's data type.
  void MakeSql(const std::string& type, const std::vector<std::string>& columns);
  void BindLatestKey(std::string_view latest_key, Query& query) const;
  Result<std::vector<Row>> ReadRows(Query query) const;

  const TypeTable* table_;
  DataType type_;  // 0: all custom ones.
  std::string name_;
  Sql sql_;
};

// One for each built-in type, in the order of the types' numbers, then the custom types'.
const std::vector<RecordTable>& RecordTables();

// Null for a type without a table.
const RecordTable* FindRecordTable(DataType type);

}  // namespace moondb
