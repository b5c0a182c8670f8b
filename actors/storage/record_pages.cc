#include "actors/storage/record_pages.h"

#include <algorithm>
#include <utility>

#include "actors/storage/record_tables.h"

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

}  // namespace

Result<proto::ReadReply> ReadPage(Database& database, const proto::ReadRequest& request) {
  std::vector<Query> queries;
  for (const RecordTable& table : RecordTables()) {
    const auto is_held = [&table](DataType type) { return table.Holds(type); };
    const auto& types = request.data_types();
    if (!types.empty() && std::none_of(types.begin(), types.end(), is_held)) continue;
    queries.push_back(request.is_newest_first() ? table.ReadNewestFirst(database)
                                                : table.ReadAfter(database, request.after_row_id()));
  }
  return ReadMerged(std::move(queries), request);
}

Result<proto::ReadReply> ReadMerged(std::vector<Query> queries, const proto::ReadRequest& request,
                                    const Accepts& accepts) {
  const std::uint32_t records_max =
      request.records_max() == 0 ? kPageRecordsDefault : std::min(request.records_max(), kPageRecordsMax);
  const std::uint32_t bytes_max =
      request.content_bytes_max() == 0 ? kPageBytesDefault : std::min(request.content_bytes_max(), kPageBytesMax);
  std::vector<Cursor> cursors;
  for (Query& query : queries) {
    cursors.push_back(Cursor{std::move(query)});
    if (const Result<void> done = Advance(cursors.back(), request, accepts); !done) {
      return tl::unexpected(done.error());
    }
  }
  proto::ReadReply reply;
  std::uint64_t bytes = 0;
  while (Cursor* next = Next(cursors, request.is_newest_first())) {
    proto::StoredRecord record = RecordTable::Read(next->query);
    bytes += record.content().size();
    const bool fits = bytes <= bytes_max && static_cast<std::uint32_t>(reply.records_size()) < records_max;
    if (!fits && reply.records_size() > 0) return reply;
    reply.add_row_ids(next->row_id());
    *reply.add_records() = std::move(record);
    if (const Result<void> done = Advance(*next, request, accepts); !done) return tl::unexpected(done.error());
  }
  reply.set_is_complete(true);
  return reply;
}

}  // namespace moondb
