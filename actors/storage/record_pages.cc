#include "actors/storage/record_pages.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "model/record_key.h"

namespace moondb {

namespace {

// A query whose current row is its first row that matches the request and is not in the page yet.
struct Cursor {
  Query query;
  bool is_at_end = false;

  std::uint64_t row_id() const { return query.Unsigned(0); }
};

using Accepts = std::function<bool(const Query&)>;

bool IsAskedFor(const google::protobuf::RepeatedField<std::uint32_t>& values, std::uint32_t value) {
  return values.empty() || std::find(values.begin(), values.end(), value) != values.end();
}

Result<void> Advance(Cursor& cursor, const proto::ReadRequest& request, const Accepts& accepts) {
  while (true) {
    const Result<bool> row = cursor.query.Step();
    if (!row) return tl::unexpected(row.error());
    cursor.is_at_end = !*row;
    if (cursor.is_at_end) return {};
    if (IsAskedFor(request.origin_agents(), static_cast<AgentId>(cursor.query.Integer(1))) &&
        IsAskedFor(request.data_types(), static_cast<DataType>(cursor.query.Integer(6))) &&
        (!accepts || accepts(cursor.query))) {
      return {};
    }
  }
}

Cursor* Next(std::vector<Cursor>& cursors, bool is_newest_first) {
  Cursor* next = nullptr;
  for (Cursor& cursor : cursors) {
    if (cursor.is_at_end) continue;
    if (!next || (cursor.row_id() < next->row_id()) != is_newest_first) next = &cursor;
  }
  return next;
}

// Fills one page while records are added in the order of the page.
class Page {
 public:
  explicit Page(const proto::ReadRequest& request)
      : records_max_(request.records_max() == 0 ? kPageRecordsDefault
                                                : std::min(request.records_max(), kPageRecordsMax)),
        bytes_max_(request.content_bytes_max() == 0 ? kPageBytesDefault
                                                    : std::min(request.content_bytes_max(), kPageBytesMax)) {}

  // Adds the current row of the query. Returns false if the page is full without it.
  bool Add(const Query& row) {
    proto::StoredRecord record = RecordTable::Read(row);
    bytes_ += record.content().size();
    const bool fits = bytes_ <= bytes_max_ && static_cast<std::uint32_t>(reply_.records_size()) < records_max_;
    if (!fits && reply_.records_size() > 0) return false;
    reply_.add_row_ids(row.Unsigned(0));
    *reply_.add_records() = std::move(record);
    return true;
  }
  proto::ReadReply Take(bool is_complete) {
    reply_.set_is_complete(is_complete);
    return std::move(reply_);
  }

 private:
  const std::uint32_t records_max_;
  const std::uint32_t bytes_max_;
  std::uint64_t bytes_ = 0;
  proto::ReadReply reply_;
};

Result<proto::ReadReply> ReadKeys(Database& database, const proto::ReadRequest& request) {
  std::map<std::uint64_t, RecordKey> found;  // By row id.
  for (const proto::RecordKey& wanted : request.keys()) {
    const RecordKey key = FromProto(wanted);
    const RecordTable* table = FindRecordTable(key.stream.type);
    if (table == nullptr) continue;
    const Result<std::optional<RecordTable::Row>> row = table->Find(database, key);
    if (!row) return tl::unexpected(row.error());
    if (*row && (*row)->row_id > request.after_row_id()) found.emplace((*row)->row_id, key);
  }
  Page page(request);
  for (const auto& [row_id, key] : found) {
    const RecordTable* table = FindRecordTable(key.stream.type);
    Query row = table->ReadInterval(database, key.stream, key.seq, key.seq, /*agent=*/0);
    const Result<bool> is_there = row.Step();
    if (!is_there) return tl::unexpected(is_there.error());
    if (*is_there && !page.Add(row)) return page.Take(/*is_complete=*/false);
  }
  return page.Take(/*is_complete=*/true);
}

}  // namespace

TimestampRange TimesOf(const proto::ReadRequest& request) {
  TimestampRange times;
  if (request.from_presence_case() == proto::ReadRequest::kFromNs) times.from_ns = request.from_ns();
  if (request.to_presence_case() == proto::ReadRequest::kToNs) times.to_ns = request.to_ns();
  return times;
}

Result<proto::ReadReply> ReadPage(Database& database, const proto::ReadRequest& request) {
  if (!request.keys().empty()) return ReadKeys(database, request);
  const TimestampRange times = TimesOf(request);
  std::vector<Query> queries;
  for (const RecordTable& table : RecordTables()) {
    const auto is_held = [&table](DataType type) { return table.Holds(type); };
    const auto& types = request.data_types();
    if (!types.empty() && std::none_of(types.begin(), types.end(), is_held)) continue;
    if (!times.is_everything()) {
      Result<Query> query = table.ReadInTimes(database, times, request.after_row_id(), request.is_newest_first());
      if (!query) return tl::unexpected(query.error());
      queries.push_back(std::move(*query));
      continue;
    }
    queries.push_back(request.is_newest_first() ? table.ReadNewestFirst(database)
                                                : table.ReadAfter(database, request.after_row_id()));
  }
  return ReadMerged(std::move(queries), request);
}

Result<proto::ReadReply> ReadMerged(std::vector<Query> queries, const proto::ReadRequest& request,
                                    const Accepts& accepts) {
  std::vector<Cursor> cursors;
  for (Query& query : queries) {
    cursors.push_back(Cursor{std::move(query)});
    if (const Result<void> done = Advance(cursors.back(), request, accepts); !done) {
      return tl::unexpected(done.error());
    }
  }
  Page page(request);
  while (Cursor* next = Next(cursors, request.is_newest_first())) {
    if (!page.Add(next->query)) return page.Take(/*is_complete=*/false);
    if (const Result<void> done = Advance(*next, request, accepts); !done) return tl::unexpected(done.error());
  }
  return page.Take(/*is_complete=*/true);
}

}  // namespace moondb
