#include "apps/moondb_sim/disk_damage.h"

#include <string>
#include <vector>

#include "actors/storage/record_tables.h"
#include "model/check.h"

namespace moondb::simulation {
namespace {

bool Next(Query& query) {
  const Result<bool> row = query.Step();
  Check(row.has_value(), "a sound database is damaged, and its power stays on");
  return *row;
}

// Returns the index of a random row; -1 if the table is empty.
std::int64_t DrawRow(Database& database, const std::string& table, std::mt19937_64& rng) {
  const auto count = static_cast<std::uint64_t>(*database.Number("SELECT count(*) FROM " + table));
  return count == 0 ? -1 : static_cast<std::int64_t>(rng() % count);
}

std::int64_t AnotherEnd(std::int64_t first, std::int64_t last, std::mt19937_64& rng) {
  const auto near = static_cast<std::int64_t>(1 + rng() % 5);
  switch (rng() % 5) {
    case 0:
      return last + near;
    case 1:
      return first - near;
    case 2:
      return INT64_MAX - near;
    case 3:
      return -near;
    default:
      return first + (last - first) / 2;
  }
}

}  // namespace

std::optional<RecordKey> DamageRecord(Database& database, std::mt19937_64& rng) {
  const std::int64_t place = DrawRow(database, "shared_record", rng);
  if (place < 0) return std::nullopt;
  RecordKey key;
  std::uint64_t row_id = 0;
  {
    Query query = database.Prepare(
        "SELECT origin, epoch, data_type, seq, row_id FROM shared_record ORDER BY row_id LIMIT 1 OFFSET ?");
    query << place;
    Check(Next(query), "the row is there");
    key = {{static_cast<AgentId>(query.Integer(0)), query.Unsigned(1), static_cast<DataType>(query.Integer(2))},
           query.Unsigned(3)};
    row_id = query.Unsigned(4);
  }
  const std::string table = FindRecordTable(key.stream.type)->name();
  std::string content;
  {
    Query query = database.Prepare("SELECT content FROM " + table + " WHERE row_id = ?");
    query << row_id;
    Check(Next(query), "the row is there");
    content = query.Bytes(0);
  }
  if (content.empty()) return std::nullopt;
  content[rng() % content.size()] ^= static_cast<char>(1 << rng() % 8);
  Query query = database.Prepare("UPDATE " + table + " SET content = ? WHERE row_id = ?");
  query << Blob{content} << row_id;
  Check(query.Run().has_value(), "the row is changed");
  return key;
}

std::optional<DamagedInterval> DamageInterval(Database& database, std::mt19937_64& rng) {
  const std::int64_t place = DrawRow(database, "have_interval", rng);
  if (place < 0) return std::nullopt;
  DamagedInterval damaged;
  std::int64_t first = 0;
  std::int64_t last = 0;
  {
    Query query = database.Prepare(
        "SELECT origin, epoch, data_type, is_dropped, first, last FROM have_interval"
        " ORDER BY origin, epoch, data_type, is_dropped, first LIMIT 1 OFFSET ?");
    query << place;
    Check(Next(query), "the interval is there");
    damaged.stream = {static_cast<AgentId>(query.Integer(0)), query.Unsigned(1),
                      static_cast<DataType>(query.Integer(2))};
    damaged.is_dropped = query.Integer(3) != 0;
    first = query.Integer(4);
    last = query.Integer(5);
  }
  const std::string end = rng() % 2 == 0 ? "first" : "last";
  Query query = database.Prepare("UPDATE OR IGNORE have_interval SET " + end +
                                 " = ? WHERE origin = ? AND epoch = ? AND data_type = ? AND is_dropped = ?"
                                 " AND first = ?");
  query << AnotherEnd(first, last, rng) << damaged.stream.origin << damaged.stream.epoch << damaged.stream.type
        << damaged.is_dropped << first;
  Check(query.Run().has_value(), "the interval is changed");
  return damaged;
}

}  // namespace moondb::simulation
