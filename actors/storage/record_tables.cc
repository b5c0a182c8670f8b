#include "actors/storage/record_tables.h"

#include <algorithm>
#include <utility>

#include "model/check.h"
#include "model/record_check.h"

namespace moondb {

namespace {

void BindCustom(const proto::Record& record, std::string_view content, Query& query) {
  const proto::CustomRecord& custom = record.custom();
  // If the payload's bytes occur more than once in the content, any occurrence will do.
  const std::size_t payload_at = content.find(custom.payload());
  Check(payload_at != std::string_view::npos, "a custom record's content holds its payload");
  query << custom.data_type() << std::string_view(custom.metadata()) << payload_at << custom.payload().size();
}

// With at most this many rows in a span of time, a page finds them by the index over time and sorts them by row id.
// With more, it visits all rows in the order of row ids: pages that each sort many rows would take quadratic time.
constexpr int kSortedRowsMax = 20'000;

constexpr char kCustomColumns[] = "data_type, metadata, payload_at, payload_bytes";

// Returns SQL for a JSON object with the columns of a row.
std::string JsonSql(const std::vector<std::string>& columns) {
  std::string sql;
  for (const std::string& column : columns) sql += (sql.empty() ? "json_object('" : ", '") + column + "', " + column;
  return sql + ")";
}

std::vector<RecordTable> MakeTables() {
  std::vector<RecordTable> tables;
  for (const TypeTable& table : TypeTables()) tables.emplace_back(&table);
  tables.emplace_back(nullptr);
  return tables;
}

}  // namespace

bool IsVersioned(DataType type) {
  const DataTypeRow* row = FindDataType(type);
  return row != nullptr && row->version != nullptr;
}

RecordOrder OrderOf(const RecordKey& key, const proto::Record& record) {
  const DataTypeRow* row = FindDataType(TypeOf(record));
  const bool is_versioned = row != nullptr && row->version != nullptr;
  return {is_versioned ? row->version(record) : RecordVersion(), key.stream.epoch, key.seq};
}

RecordTable::RecordTable(const TypeTable* table)
    : table_(table),
      type_(table == nullptr ? 0 : table->type),
      name_(table == nullptr ? "custom_record" : DataTypeName(table->type)) {
  MakeSql(table == nullptr ? "data_type" : std::to_string(type_),
          ColumnNames(table == nullptr ? kCustomColumns : table->columns));
}

void RecordTable::MakeSql(const std::string& type, const std::vector<std::string>& columns) {
  sql_.insert =
      "INSERT INTO " + name_ + "(row_id, origin, epoch, seq, timestamp_ns, latest_key, natural_key, hash, content";
  for (const std::string& column : columns) sql_.insert += ", " + column;
  sql_.insert += ") VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?";
  for (std::size_t i = 0; i < columns.size(); ++i) sql_.insert += ", ?";
  sql_.insert += ")";
  sql_.copy_to_history =
      "INSERT INTO history(data_type, row_id, epoch, seq, timestamp_ns, latest_key, hash, fields, content) SELECT " +
      type + ", row_id, epoch, seq, timestamp_ns, latest_key, hash, " + JsonSql(columns) + ", content FROM " + name_ +
      " WHERE row_id = ?";
  sql_.remove = "DELETE FROM " + name_ + " WHERE row_id = ?";
  const bool is_versioned = IsVersioned(type_);
  const std::string row = "SELECT row_id, origin, epoch, seq, hash, latest_key, " + type + ", length(content)" +
                          (is_versioned ? ", term_number, term_issuer, term_issuer_epoch, run" : "") + " FROM " + name_;
  // For a built-in type, `type` is a number. The last condition is then `20 = ?5` or similar, and true for every row.
  const std::string in_interval = " WHERE origin = ?1 AND epoch = ?2 AND seq BETWEEN ?3 AND ?4 AND " + type + " = ?5";
  sql_.find = row + " WHERE origin = ? AND epoch = ? AND seq = ? AND " + type + " = ?";
  sql_.find_by_latest_key = row + " WHERE origin = ? AND " + type + " = ? AND latest_key = ?";
  // `(x < 0), x` orders signed columns as the unsigned numbers of the same bits.
  const std::string by_version =
      "term_number < 0 DESC, term_number DESC, term_issuer DESC, term_issuer_epoch < 0 DESC, term_issuer_epoch DESC, "
      "run < 0 DESC, run DESC, ";
  sql_.find_newest = "SELECT epoch, seq FROM (SELECT epoch, seq, row_number() OVER (PARTITION BY latest_key ORDER BY " +
                     (is_versioned ? by_version : "") + "epoch < 0 DESC, epoch DESC, seq DESC) AS place FROM " + name_ +
                     " WHERE origin = ? AND " + type + " = ? AND seq IS NOT NULL) WHERE place = 1";
  sql_.find_in_interval = row + in_interval;
  sql_.find_by_natural_key = "SELECT epoch, seq, content FROM " + name_ + " WHERE natural_key = ? AND origin = ? AND " +
                             type + " = ? ORDER BY row_id LIMIT 1";
  const std::string content = "SELECT row_id, origin, epoch, seq, hash, content, " + type + " FROM " + name_;
  const std::string count = "SELECT count(*) FROM " + name_;
  sql_.read_interval = content + in_interval + " ORDER BY seq";
  sql_.count_interval = count + in_interval;
  if (knows_agent()) {
    sql_.read_interval_of_agent = content + in_interval + " AND " + table_->agent_condition + " ORDER BY seq";
    sql_.count_interval_of_agent = count + in_interval + " AND " + table_->agent_condition;
  }
  sql_.read_after = content + " WHERE row_id > ? ORDER BY row_id";
  sql_.read_newest_first = content + " ORDER BY row_id DESC";
  sql_.read = content;
  sql_.count_in_times = "SELECT count(*) FROM (SELECT 1 FROM " + name_ + " WHERE timestamp_ns BETWEEN ? AND ? LIMIT " +
                        std::to_string(kSortedRowsMax) + ")";
  sql_.read_heads = "SELECT row_id, seq, timestamp_ns, length(content) FROM " + name_ + in_interval + " ORDER BY seq";
  sql_.read_record = "SELECT content FROM " + name_ + " WHERE row_id = ?";
  sql_.read_sizes = "SELECT origin, length(content) FROM " + name_;
  sql_.count_not_shared =
      "SELECT " + type + " AS type, count(*) FROM " + name_ + " WHERE origin = ? AND epoch IS NULL GROUP BY type";
}

Result<void> RecordTable::Insert(Database& database, std::uint64_t row_id, const RecordKey& key,
                                 const proto::Record& record, std::string_view content, std::uint64_t hash) const {
  const std::string latest_key = LatestKey(record);
  const std::string natural_key = NaturalKey(record);
  Query query = database.Prepare(sql_.insert);
  query << row_id << key.stream.origin;
  if (key.seq == 0) {
    query << nullptr << nullptr;
  } else {
    query << key.stream.epoch << key.seq;
  }
  query << record.timestamp_ns();
  BindLatestKey(latest_key, query);
  query << std::string_view(natural_key) << hash << Blob{content};
  if (table_ == nullptr) {
    BindCustom(record, content, query);
  } else {
    table_->bind(record, query);
  }
  return query.Run();
}

Result<void> RecordTable::Delete(Database& database, std::uint64_t row_id) const {
  return (database.Prepare(sql_.remove) << row_id).Run();
}

void RecordTable::BindLatestKey(std::string_view latest_key, Query& query) const {
  if (type_ == 0) {
    query << Blob{latest_key};
  } else {
    query << latest_key;
  }
}

Result<std::vector<RecordTable::Row>> RecordTable::ReadRows(Query query) const {
  std::vector<Row> rows;
  while (true) {
    const Result<bool> step = query.Step();
    if (!step) return tl::unexpected(step.error());
    if (!*step) return rows;
    const StreamKey stream{static_cast<AgentId>(query.Integer(1)), query.Unsigned(2),
                           static_cast<DataType>(query.Integer(6))};
    RecordVersion version;
    if (IsVersioned(type_)) {
      version = {{query.Unsigned(8), static_cast<AgentId>(query.Integer(9)), query.Unsigned(10)}, query.Unsigned(11)};
    }
    rows.push_back(Row{query.Unsigned(0), RecordKey{stream, query.Unsigned(3)}, query.Unsigned(4),
                       std::string(query.Bytes(5)), query.Unsigned(7), version});
  }
}

Result<std::optional<RecordTable::Row>> RecordTable::Find(Database& database, const RecordKey& key) const {
  Query query = database.Prepare(sql_.find);
  query << key.stream.origin << key.stream.epoch << key.seq << key.stream.type;
  const Result<std::vector<Row>> rows = ReadRows(std::move(query));
  if (!rows) return tl::unexpected(rows.error());
  return rows->empty() ? std::nullopt : std::optional<Row>(rows->front());
}

Result<std::vector<RecordTable::Row>> RecordTable::FindStates(Database& database, AgentId origin, DataType type,
                                                              std::string_view latest_key) const {
  Query query = database.Prepare(sql_.find_by_latest_key);
  query << origin << type;
  BindLatestKey(latest_key, query);
  Result<std::vector<Row>> rows = ReadRows(std::move(query));
  if (!rows) return rows;
  std::vector<Row> states;
  for (Row& row : *rows) {
    const Result<proto::Record> record = ReadRecord(database, row.row_id);
    if (!record) return tl::unexpected(record.error());
    if (record->is_state()) states.push_back(std::move(row));
  }
  return states;
}

Result<std::map<std::uint64_t, IntervalSet>> RecordTable::FindNewest(Database& database, AgentId origin,
                                                                     DataType type) const {
  Query query = database.Prepare(sql_.find_newest);
  query << origin << type;
  std::map<std::uint64_t, IntervalSet> newest;
  while (true) {
    const Result<bool> step = query.Step();
    if (!step) return tl::unexpected(step.error());
    if (!*step) return newest;
    newest[query.Unsigned(0)].Add(query.Unsigned(1));
  }
}

Result<std::vector<RecordTable::Row>> RecordTable::FindInInterval(Database& database, const StreamKey& stream,
                                                                  std::uint64_t first, std::uint64_t last) const {
  Query query = database.Prepare(sql_.find_in_interval);
  query << stream.origin << stream.epoch << first << last << stream.type;
  return ReadRows(std::move(query));
}

Result<std::optional<RecordTable::Named>> RecordTable::FindByNaturalKey(Database& database, AgentId origin,
                                                                        DataType type,
                                                                        std::string_view natural_key) const {
  Query query = database.Prepare(sql_.find_by_natural_key);
  query << natural_key << origin << type;
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  if (!*row) return std::optional<Named>();
  const RecordKey key{StreamKey{origin, query.Unsigned(0), type}, query.Unsigned(1)};
  return std::optional<Named>(Named{key, std::string(query.Bytes(2))});
}

Query RecordTable::ReadInterval(Database& database, const StreamKey& stream, std::uint64_t first, std::uint64_t last,
                                AgentId agent) const {
  const bool is_filtered = agent != 0 && knows_agent();
  Query query = database.Prepare(is_filtered ? sql_.read_interval_of_agent : sql_.read_interval);
  query << stream.origin << stream.epoch << first << last << stream.type;
  if (is_filtered) query << agent;
  return query;
}

Result<std::uint64_t> RecordTable::CountInterval(Database& database, const StreamKey& stream, std::uint64_t first,
                                                 std::uint64_t last, AgentId agent) const {
  const bool is_filtered = agent != 0 && knows_agent();
  Query query = database.Prepare(is_filtered ? sql_.count_interval_of_agent : sql_.count_interval);
  query << stream.origin << stream.epoch << first << last << stream.type;
  if (is_filtered) query << agent;
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  return query.Unsigned(0);
}

Query RecordTable::ReadHeads(Database& database, const StreamKey& stream, std::uint64_t first,
                             std::uint64_t last) const {
  Query query = database.Prepare(sql_.read_heads);
  query << stream.origin << stream.epoch << first << last << stream.type;
  return query;
}

Result<proto::Record> RecordTable::ReadRecord(Database& database, std::uint64_t row_id) const {
  Query query = database.Prepare(sql_.read_record);
  query << row_id;
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  if (!*row) return Fail(ErrorCode::kNotFound, "there is no such row", name_);
  proto::Record record;
  const std::string_view content = query.Bytes(0);
  if (!record.ParseFromArray(content.data(), static_cast<int>(content.size()))) {
    return Fail(ErrorCode::kCorrupt, "a row of " + name_ + " does not parse");
  }
  return record;
}

// Adds up the sizes here, not in SQL. With GROUP BY, SQLite would visit the rows in the order of the index by origin
// instead of the table's order, which is slower.
Result<std::map<AgentId, RecordTable::Size>> RecordTable::SizesByOrigin(Database& database) const {
  std::map<AgentId, Size> sizes;
  Query query = database.Prepare(sql_.read_sizes);
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return sizes;
    Size& size = sizes[static_cast<AgentId>(query.Integer(0))];
    ++size.row_count;
    size.content_bytes += static_cast<std::uint64_t>(query.Integer(1));
  }
}

Query RecordTable::ReadAfter(Database& database, std::uint64_t row_id) const {
  Query query = database.Prepare(sql_.read_after);
  query << row_id;
  return query;
}

Query RecordTable::ReadNewestFirst(Database& database) const { return database.Prepare(sql_.read_newest_first); }

Result<Query> RecordTable::ReadInTimes(Database& database, const TimestampRange& times, std::uint64_t row_id,
                                       bool is_newest_first) const {
  Query counted = database.Prepare(sql_.count_in_times);
  counted << times.from_ns << times.to_ns;
  if (const Result<bool> row = counted.Step(); !row) return tl::unexpected(row.error());
  const bool are_few = counted.Integer(0) < kSortedRowsMax;
  Query query =
      database.Prepare(sql_.read + " WHERE row_id > ? AND " +
                       (are_few ? "row_id IN (SELECT row_id FROM " + name_ + " WHERE timestamp_ns BETWEEN ? AND ?)"
                                : "+timestamp_ns BETWEEN ? AND ?") +
                       " ORDER BY row_id" + (is_newest_first ? " DESC" : ""));
  query << (is_newest_first ? 0 : row_id) << times.from_ns << times.to_ns;
  return query;
}

Result<std::map<DataType, std::uint64_t>> RecordTable::CountNotShared(Database& database, AgentId origin) const {
  Query query = database.Prepare(sql_.count_not_shared);
  query << origin;
  std::map<DataType, std::uint64_t> counts;
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return counts;
    counts[static_cast<DataType>(query.Integer(0))] = query.Unsigned(1);
  }
}

proto::StoredRecord RecordTable::Read(const Query& query) {
  proto::StoredRecord record;
  record.mutable_key()->set_origin_agent(static_cast<AgentId>(query.Integer(1)));
  record.mutable_key()->set_epoch(query.Unsigned(2));
  record.mutable_key()->set_data_type(static_cast<DataType>(query.Integer(6)));
  record.mutable_key()->set_seq(query.Unsigned(3));
  record.set_hash(query.Unsigned(4));
  record.set_content(std::string(query.Bytes(5)));
  return record;
}

const std::vector<RecordTable>& RecordTables() {
  static const std::vector<RecordTable> kTables = MakeTables();
  return kTables;
}

const RecordTable* FindRecordTable(DataType type) {
  const std::vector<RecordTable>& tables = RecordTables();
  const auto found =
      std::find_if(tables.begin(), tables.end(), [type](const RecordTable& table) { return table.Holds(type); });
  return found == tables.end() ? nullptr : &*found;
}

}  // namespace moondb
