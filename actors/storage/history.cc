#include "actors/storage/history.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "actors/storage/clock_judge.h"
#include "actors/storage/prune.h"
#include "actors/storage/record_pages.h"
#include "model/record_hash.h"
#include "proto/retention.pb.h"

namespace moondb {

namespace {

// SQL for the approximate size in bytes of a row in the file. A row that shares its page takes 54 bytes more than its
// content and fields (measured: other columns, B-tree and unused space). A row longer than a quarter of a page takes
// whole pages.
constexpr char kRowBytes[] =
    "CASE WHEN length(content) + length(fields) < 960 THEN length(content) + length(fields) + 54"
    " ELSE 489 + (length(content) + length(fields) + 3642) / 4092 * 4096 END";
constexpr std::uint64_t kRowBytesMin = 54;

bool IsSound(AgentId self, const Query& query) {
  const RecordKey key{{self, query.Unsigned(2), static_cast<DataType>(query.Integer(6))}, query.Unsigned(3)};
  return HashRecord(key, query.Bytes(5)) == query.Unsigned(4);
}

// Selects the columns of RecordTable::ReadAfter. The type is part of the SQL text, because one page reads several types
// at the same time and a prepared statement serves one query at a time.
std::string ReadSql(AgentId self, DataType type) {
  return "SELECT row_id, " + std::to_string(self) +
         ", epoch, seq, hash, content, data_type FROM history WHERE data_type = " + std::to_string(type);
}

// Returns whether the record's age is unknown. Older stores have unmarked records from before 2020.
bool IsOfSuspectClock(std::string_view content) {
  proto::Record record;
  return !record.ParseFromArray(content.data(), static_cast<int>(content.size())) || record.is_clock_suspect() ||
         record.timestamp_ns() < kTimestampMin_ns;
}

struct Candidate {
  std::uint64_t row_id;
  DataType type;
  std::uint64_t bytes;
};

}  // namespace

Result<void> History::Load(Database& database, const HaveSet& have) {
  types_.clear();
  draft_.reset();
  not_dropped_.clear();
  Query rows = database.Prepare(std::string("SELECT data_type, row_id, ") + kRowBytes + ", epoch, seq FROM history");
  while (true) {
    const Result<bool> row = rows.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
    const auto data_type = static_cast<DataType>(rows.Integer(0));
    const std::uint64_t row_id = rows.Unsigned(1);
    OfType& type = types_[data_type];
    if (type.sum.count == 0 || row_id < type.oldest_row_id) type.oldest_row_id = row_id;
    type.sum.count += 1;
    type.sum.bytes += rows.Unsigned(2);
    const RecordKey key{{self_, rows.Unsigned(3), data_type}, rows.Unsigned(4)};
    if (key.seq != 0 && !have.Get(key.stream).dropped.Contains(key.seq)) not_dropped_[key] = row_id;
  }
}

History::Sum History::SumOf(const Types& types) {
  Sum sum;
  for (const auto& [type, of_type] : types) {
    sum.count += of_type.sum.count;
    sum.bytes += of_type.sum.bytes;
  }
  return sum;
}

Result<std::vector<History::Found>> History::FindDamaged(Database& database) const {
  std::vector<Found> damaged;
  Query query = database.Prepare("SELECT row_id, 0, epoch, seq, hash, content, data_type FROM history");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return damaged;
    if (!IsSound(self_, query)) damaged.push_back({static_cast<DataType>(query.Integer(6)), query.Unsigned(0)});
  }
}

Result<std::uint64_t> History::MaxRowId(Database& database) const {
  const Result<std::int64_t> highest = database.Number("SELECT coalesce(max(row_id), 0) FROM history");
  if (!highest) return tl::unexpected(highest.error());
  return static_cast<std::uint64_t>(*highest);
}

History::Types& History::Draft() {
  if (!draft_) draft_ = types_;
  return *draft_;
}

KeepRule History::RuleOf(DataType type) const {
  const auto rule = rules_.keep.find(type);
  return rule == rules_.keep.end() ? KeepRule{} : rule->second;
}

void History::Keep() {
  if (draft_) types_ = *std::exchange(draft_, std::nullopt);
}

Result<void> History::Take(Database& database, const RecordTable& table, const RecordTable::Row& row) {
  const DataType type = row.key.stream.type;
  const bool is_kept = rules_.keep.contains(type) && RuleOf(type).KeepsAny();
  if (!is_kept || row.content_bytes + kRowBytesMin > rules_.bytes_max) return {};
  std::uint64_t bytes = 0;
  {
    Query query = database.Prepare(table.copy_to_history() + " RETURNING " + kRowBytes);
    query << row.row_id;
    const Result<bool> copied = query.Step();
    if (!copied) return tl::unexpected(copied.error());
    if (!*copied) return {};  // The row has been deleted already.
    bytes = query.Unsigned(0);
    if (const Result<void> done = query.Run(); !done) return done;
  }
  OfType& of_type = Draft()[type];
  const bool is_first = of_type.sum.count == 0;
  of_type.sum.count += 1;
  of_type.sum.bytes += bytes;
  if (is_first || row.row_id < of_type.oldest_row_id) of_type.oldest_row_id = row.row_id;
  of_type.seen_row_id = std::min(of_type.seen_row_id, row.row_id - 1);
  while (SumOf(Now()).bytes > rules_.bytes_max) {
    if (const Result<std::uint64_t> dropped = DropOldest(database); !dropped) return tl::unexpected(dropped.error());
  }
  return {};
}

Result<void> History::Delete(Database& database, DataType type, std::uint64_t row_id, std::uint64_t bytes) {
  {
    Query query = database.Prepare("DELETE FROM history WHERE data_type = ? AND row_id = ?");
    query << type << row_id;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  OfType& of_type = Draft()[type];
  of_type.sum.count -= 1;
  of_type.sum.bytes -= bytes;
  if (of_type.sum.count == 0) {
    Draft().erase(type);
    return {};
  }
  if (row_id != of_type.oldest_row_id) return {};
  Query next =
      database.Prepare("SELECT row_id FROM history WHERE data_type = ? AND row_id > ? ORDER BY row_id LIMIT 1");
  next << type << row_id;
  const Result<bool> row = next.Step();
  if (!row) return tl::unexpected(row.error());
  if (!*row) return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: its history has lost rows");
  of_type.oldest_row_id = next.Unsigned(0);
  return {};
}

Result<void> History::Remove(Database& database, const RecordKey& key) {
  const auto found = not_dropped_.find(key);
  if (found == not_dropped_.end()) return {};
  const Result<std::optional<std::uint64_t>> bytes = FindBytes(database, key.stream.type, found->second);
  if (!bytes) return tl::unexpected(bytes.error());
  return *bytes ? Delete(database, key.stream.type, found->second, **bytes) : Result<void>();
}

Result<std::optional<std::uint64_t>> History::FindBytes(Database& database, DataType type, std::uint64_t row_id) {
  Query query =
      database.Prepare(std::string("SELECT ") + kRowBytes + " FROM history WHERE data_type = ? AND row_id = ?");
  query << type << row_id;
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  return *row ? std::optional(query.Unsigned(0)) : std::nullopt;
}

Result<std::uint64_t> History::DropOldest(Database& database) {
  const Types& types = Now();
  const auto oldest = std::min_element(types.begin(), types.end(), [](const auto& a, const auto& b) {
    return a.second.oldest_row_id < b.second.oldest_row_id;
  });
  const DataType type = oldest->first;
  const std::uint64_t row_id = oldest->second.oldest_row_id;
  const Result<std::optional<std::uint64_t>> bytes = FindBytes(database, type, row_id);
  if (!bytes) return tl::unexpected(bytes.error());
  if (!*bytes) return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: its history lacks a row");
  if (const Result<void> done = Delete(database, type, row_id, **bytes); !done) return tl::unexpected(done.error());
  return **bytes;
}

Result<std::uint64_t> History::Drop(Database& database, std::uint64_t bytes) {
  std::uint64_t freed = 0;
  while (freed < bytes && !Now().empty()) {
    const Result<std::uint64_t> dropped = DropOldest(database);
    if (!dropped) return dropped;
    freed += *dropped;
  }
  return freed;
}

bool History::NeedsTrim() const {
  if (sum().bytes > rules_.bytes_max) return true;
  return std::any_of(types_.begin(), types_.end(),
                     [this](const auto& type) { return !RuleOf(type.first).IsOfAnyAge(); });
}

Result<bool> History::Trim(Database& database, std::optional<std::int64_t> utc_now_ns) {
  std::size_t rows_left = kHistoryTrimRowsMax;
  const Types types = Now();
  for (const auto& [type, of_type] : types) {
    const KeepRule rule = RuleOf(type);
    std::optional<std::int64_t> timestamp_before_ns;
    if (rule.KeepsAny()) {
      if (rule.IsOfAnyAge() || !utc_now_ns) continue;
      timestamp_before_ns = *utc_now_ns - std::chrono::duration_cast<std::chrono::nanoseconds>(rule.at_most).count();
    }
    if (const Result<void> done = DropOlder(database, type, timestamp_before_ns, rows_left); !done) {
      return tl::unexpected(done.error());
    }
  }
  for (; rows_left > 0 && SumOf(Now()).bytes > rules_.bytes_max; --rows_left) {
    if (const Result<std::uint64_t> dropped = DropOldest(database); !dropped) return tl::unexpected(dropped.error());
  }
  return rows_left == 0;
}

// Removes rows of one type whose timestamp is before `timestamp_before_ns`; null removes rows of any age. Reads at most
// `rows_left` rows in the order of storing, up to the first row that is too young. Subtracts the number of rows read
// from `rows_left`.
Result<void> History::DropOlder(Database& database, DataType type, std::optional<std::int64_t> timestamp_before_ns,
                                std::size_t& rows_left) {
  std::vector<Candidate> expired;
  std::uint64_t seen_row_id = Now().at(type).seen_row_id;
  {
    Query query = database.Prepare(std::string("SELECT row_id, timestamp_ns, ") + kRowBytes +
                                   ", content FROM history WHERE data_type = ? AND row_id > ? ORDER BY row_id LIMIT ?");
    query << type << (timestamp_before_ns ? seen_row_id : 0) << rows_left;
    while (true) {
      const Result<bool> row = query.Step();
      if (!row) return tl::unexpected(row.error());
      if (!*row) break;
      --rows_left;
      if (timestamp_before_ns && query.Integer(1) >= *timestamp_before_ns) break;
      seen_row_id = query.Unsigned(0);
      if (timestamp_before_ns && IsOfSuspectClock(query.Bytes(3))) continue;
      expired.push_back({query.Unsigned(0), type, query.Unsigned(2)});
    }
  }
  for (const Candidate& row : expired) {
    if (const Result<void> done = Delete(database, type, row.row_id, row.bytes); !done) return done;
  }
  if (const auto of_type = Draft().find(type); of_type != Draft().end()) of_type->second.seen_row_id = seen_row_id;
  return {};
}

Result<proto::PruneReply> History::Prune(Database& database, const proto::PruneRequest& request,
                                         std::int64_t utc_now_ns) {
  if (const Result<void> checked = CheckPruneLimits(request); !checked) return tl::unexpected(checked.error());
  const bool is_by_age = request.older_than_s() > 0;
  const std::int64_t timestamp_before_ns = utc_now_ns - static_cast<std::int64_t>(request.older_than_s() * 1e9);
  const std::size_t rows_max = request.is_dry_run() ? kPruneCandidatesMax : kHistoryTrimRowsMax;
  proto::PruneReply reply;
  reply.set_is_complete(true);
  std::vector<Candidate> rows;
  for (const auto& [type, of_type] : Now()) {
    const auto& types = request.data_types();
    if (!types.empty() && std::find(types.begin(), types.end(), type) == types.end()) continue;
    Query query = database.Prepare(std::string("SELECT row_id, ") + kRowBytes +
                                   ", content FROM history WHERE data_type = ? AND timestamp_ns <= ? ORDER BY row_id");
    query << type << (is_by_age ? timestamp_before_ns - 1 : INT64_MAX);
    std::size_t found = 0;
    while (true) {
      const Result<bool> row = query.Step();
      if (!row) return tl::unexpected(row.error());
      if (!*row) break;
      if (is_by_age && IsOfSuspectClock(query.Bytes(2))) continue;
      if (++found > rows_max) break;
      rows.push_back({query.Unsigned(0), type, query.Unsigned(1)});
    }
  }
  std::sort(rows.begin(), rows.end(), [](const Candidate& a, const Candidate& b) { return a.row_id < b.row_id; });
  std::map<DataType, proto::PrunedType> pruned;
  double bytes = 0;
  std::size_t count = 0;
  for (const Candidate& row : rows) {
    // Stop once the rows counted so far have at least the requested number of bytes.
    if (request.content_bytes_max() > 0 && bytes >= request.content_bytes_max()) break;
    if (count == rows_max) {
      reply.set_is_complete(false);
      break;
    }
    ++count;
    bytes += static_cast<double>(row.bytes);
    proto::PrunedType& of_type = pruned[row.type];
    of_type.set_record_count(of_type.record_count() + 1);
    of_type.set_content_bytes(of_type.content_bytes() + static_cast<double>(row.bytes));
    if (request.is_dry_run()) continue;
    if (const Result<void> done = Delete(database, row.type, row.row_id, row.bytes); !done) {
      return tl::unexpected(done.error());
    }
  }
  // At most `rows_max` rows are read per type, so more rows may match the request.
  if (!request.is_dry_run() && count == rows_max) reply.set_is_complete(false);
  for (auto& [type, of_type] : pruned) {
    of_type.set_data_type(type);
    *reply.add_pruned() = std::move(of_type);
  }
  return reply;
}

Result<proto::ReadReply> History::Read(Database& database, const proto::ReadRequest& request) const {
  const TimestampRange times = TimesOf(request);
  std::vector<Query> queries;
  for (const auto& [type, of_type] : types_) {
    const auto& types = request.data_types();
    if (!types.empty() && std::find(types.begin(), types.end(), type) == types.end()) continue;
    const bool is_newest_first = request.is_newest_first();
    queries.push_back(database.Prepare(ReadSql(self_, type) +
                                       " AND timestamp_ns BETWEEN ? AND ? AND row_id > ? ORDER BY row_id" +
                                       (is_newest_first ? " DESC" : "")));
    queries.back() << times.from_ns << times.to_ns << (is_newest_first ? 0 : request.after_row_id());
  }
  return ReadMerged(std::move(queries), request, [this](const Query& query) {
    if (IsSound(self_, query)) return true;
    spdlog::error("storage: a row of the history is damaged and excluded: {} of {}", query.Unsigned(0),
                  DataTypeName(static_cast<DataType>(query.Integer(6))));
    return false;
  });
}

}  // namespace moondb
