#include "actors/storage/schema.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "actors/storage/type_tables.h"
#include "model/data_types.h"

namespace moondb {

namespace {

constexpr char kCommonTablesV1[] = R"sql(
CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE team_agent(agent_id INTEGER PRIMARY KEY) STRICT;
CREATE TABLE have_interval(
  origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL, is_dropped INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL,
  PRIMARY KEY(origin, epoch, data_type, is_dropped, first)) STRICT, WITHOUT ROWID;
CREATE TABLE peer_have(
  peer INTEGER NOT NULL, origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL,
  PRIMARY KEY(peer, origin, epoch, data_type, first)) STRICT, WITHOUT ROWID;
CREATE TABLE handed_over(
  peer INTEGER NOT NULL, origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL,
  seq INTEGER NOT NULL,
  PRIMARY KEY(peer, origin, epoch, data_type, seq)) STRICT, WITHOUT ROWID;
CREATE TABLE role_history(
  row_id INTEGER PRIMARY KEY, term_number INTEGER NOT NULL, leader INTEGER NOT NULL, survivor INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL, content BLOB NOT NULL) STRICT;
INSERT INTO meta VALUES('next_row_id', 1);
)sql";

constexpr char kIndexesV1[] = R"sql(
CREATE INDEX pose_graph_node_natural ON pose_graph_node(natural_key, origin);
CREATE INDEX pose_graph_edge_natural ON pose_graph_edge(natural_key, origin);
CREATE INDEX optimized_pose_latest ON optimized_pose(latest_key, origin);
CREATE INDEX edge_verdict_latest ON edge_verdict(latest_key, origin);
)sql";

// A node's pose is the newest optimized one, else the raw one of the record that stands: of several under one natural
// key the smallest record key. `(x < 0), x` orders unsigned numbers.
constexpr char kViewsV1[] = R"sql(
CREATE VIEW replica AS
  SELECT printf('%d.%016x.%d.%d', origin, epoch, data_type, seq) AS replica_id, origin AS agent_id
  FROM shared_record;

CREATE VIEW replication_log AS
  SELECT replica_id, agent_id, destination_id, sent_status, ack FROM (
    SELECT printf('%d.%016x.%d.%d', r.origin, r.epoch, r.data_type, r.seq) AS replica_id, r.origin AS agent_id,
      d.agent_id AS destination_id,
      EXISTS(SELECT 1 FROM handed_over h WHERE h.peer = d.agent_id AND h.origin = r.origin AND h.epoch = r.epoch
             AND h.data_type = r.data_type AND h.seq = r.seq) AS sent_status,
      EXISTS(SELECT 1 FROM peer_have p WHERE p.peer = d.agent_id AND p.origin = r.origin AND p.epoch = r.epoch
             AND p.data_type = r.data_type AND r.seq BETWEEN p.first AND p.last) AS ack
    FROM shared_record r CROSS JOIN team_agent d
    WHERE d.agent_id <> (SELECT value FROM meta WHERE name = 'own_agent'))
  WHERE sent_status OR ack
  UNION ALL
  SELECT printf('%d.%016x.%d.%d', origin, epoch, data_type, seq), origin, own.value, 0, 1
  FROM shared_record CROSS JOIN meta own
  WHERE own.name = 'own_agent' AND origin <> own.value;

CREATE VIEW v_node_pose AS
  WITH raw AS (
    SELECT *, row_number() OVER (PARTITION BY node_agent, node_index
      ORDER BY epoch IS NULL, origin, epoch < 0, epoch, seq, row_id) AS place FROM pose_graph_node),
  best AS (
    SELECT *, row_number() OVER (PARTITION BY node_agent, node_index
      ORDER BY term_number < 0 DESC, term_number DESC, term_issuer DESC, term_issuer_epoch < 0 DESC,
        term_issuer_epoch DESC, run < 0 DESC, run DESC, row_id DESC) AS place FROM optimized_pose)
  SELECT raw.node_agent, raw.node_index, raw.stamp_ns, best.row_id IS NOT NULL AS is_optimized,
    COALESCE(best.x, raw.x) AS x, COALESCE(best.y, raw.y) AS y, COALESCE(best.z, raw.z) AS z,
    COALESCE(best.qx, raw.qx) AS qx, COALESCE(best.qy, raw.qy) AS qy, COALESCE(best.qz, raw.qz) AS qz,
    COALESCE(best.qw, raw.qw) AS qw
  FROM raw LEFT JOIN best
    ON best.node_agent = raw.node_agent AND best.node_index = raw.node_index AND best.place = 1
  WHERE raw.place = 1;
)sql";

// The tables of data types that a version of the schema brought.
std::vector<const TypeTable*> TablesOf(int version) {
  std::vector<const TypeTable*> tables;
  for (const TypeTable& table : TypeTables()) {
    if (table.since == version) tables.push_back(&table);
  }
  return tables;
}

std::string TableSql(const TypeTable& table) {
  return "CREATE TABLE " + DataTypeName(table.type) +
         "(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,"
         "latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL," +
         table.columns +
         ", content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;";
}

// One view over the tables that stand by `version`, in the order in which they came.
std::string SharedRecordSql(int version) {
  std::string sql = "CREATE VIEW shared_record AS ";
  const char* joint = "";
  for (int since = 1; since <= version; ++since) {
    for (const TypeTable* table : TablesOf(since)) {
      sql += std::string(joint) + "SELECT " + std::to_string(table->type) +
             " AS data_type, row_id, origin, epoch, seq, stamp_ns FROM " + DataTypeName(table->type) +
             " WHERE seq IS NOT NULL";
      joint = " UNION ALL ";
    }
    if (since == 2) {
      sql +=
          " UNION ALL SELECT data_type, row_id, origin, epoch, seq, stamp_ns FROM custom_record WHERE seq IS NOT NULL";
    }
  }
  return sql + ";";
}

std::string Version1() {
  std::string sql = kCommonTablesV1;
  for (const TypeTable* table : TablesOf(1)) sql += TableSql(*table);
  return sql + kIndexesV1 + SharedRecordSql(1) + kViewsV1;
}

// Version 2: custom data types. A key may be any bytes, so it is no TEXT. The payload lies once in the file, in
// `content`.
constexpr char kCustomV2[] = R"sql(
CREATE TABLE custom_type(data_type INTEGER PRIMARY KEY, name TEXT NOT NULL) STRICT;
CREATE TABLE custom_record(
  row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,
  latest_key BLOB NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,
  data_type INTEGER NOT NULL, metadata TEXT NOT NULL, payload_at INTEGER NOT NULL, payload_bytes INTEGER NOT NULL,
  content BLOB NOT NULL,
  payload BLOB GENERATED ALWAYS AS (substr(content, payload_at + 1, payload_bytes)) VIRTUAL,
  CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, data_type, seq)) STRICT;
CREATE INDEX custom_record_latest ON custom_record(latest_key, data_type, origin);
CREATE VIEW v_custom_record AS
  SELECT r.row_id, r.data_type, COALESCE(t.name, 'type_' || r.data_type) AS type, r.origin AS agent_id,
    CASE WHEN r.seq IS NOT NULL THEN printf('%d.%016x.%d.%d', r.origin, r.epoch, r.data_type, r.seq) END AS record_id,
    r.stamp_ns, r.latest_key, r.metadata, r.payload
  FROM custom_record r LEFT JOIN custom_type t ON t.data_type = r.data_type;
DROP VIEW shared_record;
)sql";

std::string Version2() { return kCustomV2 + SharedRecordSql(2); }

constexpr char kVersion3[] =
    "ALTER TABLE have_interval ADD COLUMN hash INTEGER; ALTER TABLE role_history ADD COLUMN hash INTEGER;";

// Version 4: maps that operators distrust.
constexpr char kQuarantineV4[] = R"sql(
CREATE TABLE map_quarantine(
  row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,
  latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,
  maps_of INTEGER NOT NULL, from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL, reason TEXT NOT NULL,
  lifts TEXT NOT NULL,
  content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
DROP VIEW shared_record;
)sql";

std::string Version4() { return kQuarantineV4 + SharedRecordSql(4); }

// Version 5: the team's story.
constexpr char kEventV5[] = R"sql(
CREATE TABLE agent_event(
  row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,
  latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,
  kind INTEGER NOT NULL, text TEXT NOT NULL, given_by TEXT NOT NULL,
  content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE VIEW v_event AS
  SELECT row_id, origin AS agent_id, stamp_ns,
    CASE kind WHEN 1 THEN 'started' WHEN 2 THEN 'command' WHEN 3 THEN 'roles' WHEN 4 THEN 'restart'
      WHEN 5 THEN 'sharing' WHEN 6 THEN 'rejected' ELSE 'unknown' END AS kind, text, given_by
  FROM agent_event;
DROP VIEW shared_record;
)sql";

std::string Version5() { return kEventV5 + SharedRecordSql(5); }

// Version 6: what was written a day, and bundles for the ground.
constexpr char kVersion6[] = R"sql(
CREATE TABLE written(day INTEGER PRIMARY KEY, bytes INTEGER NOT NULL) STRICT;
CREATE TABLE downlink_bundle(
  number INTEGER PRIMARY KEY, made_ns INTEGER NOT NULL, record_count INTEGER NOT NULL, bytes INTEGER NOT NULL,
  hash INTEGER NOT NULL, have BLOB NOT NULL, file BLOB) STRICT;
)sql";

// Version 7. Which epochs this file's history began.
constexpr char kOwnEpochV7[] = "CREATE TABLE own_epoch(epoch INTEGER PRIMARY KEY, hash INTEGER NOT NULL) STRICT;";

// What a robot's own superseded states were (actors/storage/history.h). Clustered by type.
constexpr char kHistoryTableV7[] = R"sql(
CREATE TABLE history(
  data_type INTEGER NOT NULL, row_id INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,
  latest_key ANY NOT NULL, hash INTEGER NOT NULL, fields TEXT NOT NULL, content BLOB NOT NULL,
  PRIMARY KEY(data_type, row_id)) STRICT, WITHOUT ROWID;
)sql";

constexpr char kHistoryViewV7[] = R"sql(
CREATE VIEW v_history AS
  SELECT h.row_id, h.data_type, $TYPE AS type, own.value AS agent_id,
    CASE WHEN h.seq IS NOT NULL THEN printf('%d.%016x.%d.%d', own.value, h.epoch, h.data_type, h.seq) END AS record_id,
    h.stamp_ns, h.latest_key, h.fields,
    substr(h.content, json_extract(h.fields, '$.payload_at') + 1, json_extract(h.fields, '$.payload_bytes')) AS payload
  FROM history h CROSS JOIN meta own LEFT JOIN custom_type t ON t.data_type = h.data_type
  WHERE own.name = 'own_agent';
)sql";

// The kinds of events that operators acknowledge (model/event.h).
constexpr char kEventViewV7[] = R"sql(
DROP VIEW v_event;
CREATE VIEW v_event AS
  SELECT row_id, origin AS agent_id, stamp_ns,
    CASE kind WHEN 1 THEN 'started' WHEN 2 THEN 'command' WHEN 3 THEN 'roles' WHEN 4 THEN 'restart'
      WHEN 5 THEN 'sharing' WHEN 6 THEN 'rejected' WHEN 7 THEN 'damage' WHEN 8 THEN 'lost' WHEN 9 THEN 'stopped'
      WHEN 10 THEN 'acknowledged' ELSE 'unknown' END AS kind, text, given_by
  FROM agent_event;
)sql";

// The view v_history over the types of these tables.
std::string HistorySql(std::string sql, const std::vector<const TypeTable*>& tables) {
  std::string type = "CASE h.data_type";
  for (const TypeTable* table : tables) {
    type += " WHEN " + std::to_string(table->type) + " THEN '" + DataTypeName(table->type) + "'";
  }
  type += " ELSE COALESCE(t.name, 'type_' || h.data_type) END";
  return sql.replace(sql.find("$TYPE"), 5, type);
}

std::string Version7() {
  return std::string(kOwnEpochV7) + kHistoryTableV7 + HistorySql(kHistoryViewV7, TablesOf(1)) + kEventViewV7;
}

// A version that brings built-in types: their tables and indexes, and the views over all types.
std::string VersionWithTypes(int version) {
  std::string sql;
  for (const TypeTable* table : TablesOf(version)) {
    const std::string name = DataTypeName(table->type);
    const DataTypeRow* row = FindDataType(table->type);
    sql += TableSql(*table);
    const auto add_index = [&](const std::string& key) {
      sql += "CREATE INDEX " + name + "_" + key + " ON " + name + "(" + key + "_key, origin);";
    };
    if (row != nullptr && row->natural_key != nullptr) add_index("natural");
    if (row != nullptr && row->latest_key != nullptr) add_index("latest");
  }
  std::vector<const TypeTable*> tables;
  for (const TypeTable& table : TypeTables()) {
    if (table.since <= version) tables.push_back(&table);
  }
  return sql + "DROP VIEW shared_record;" + SharedRecordSql(version) + "DROP VIEW v_history;" +
         HistorySql(kHistoryViewV7, tables);
}

// The last version whose step is written out here; each later one brings types.
constexpr int kVersionWrittenOut = 7;

// The step from version `from` to the next.
std::string Step(int from) {
  switch (from) {
    case 0:
      return Version1();
    case 1:
      return Version2();
    case 2:
      return kVersion3;
    case 3:
      return Version4();
    case 4:
      return Version5();
    case 5:
      return kVersion6;
    case 6:
      return Version7();
    default:
      return VersionWithTypes(from + 1);
  }
}

// No version of moondb will ever have that number: it is damage.
constexpr std::int64_t kVersionMax = 10'000;

Result<void> Upgrade(Database& database, int from, int to) {
  for (int version = from; version < to; ++version) {
    if (const Result<void> done = database.Execute(Step(version)); !done) return done;
  }
  return database.Execute("PRAGMA user_version=" + std::to_string(to));
}

Result<std::set<std::string>> StatementsOf(Database& database) {
  std::set<std::string> statements;
  Query query =
      database.Prepare("SELECT type || ' ' || name || ' ' || tbl_name || ' ' || coalesce(sql, '') FROM sqlite_master");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return statements;
    statements.emplace(query.Bytes(0));
  }
}

}  // namespace

int SchemaVersion() {
  int version = kVersionWrittenOut;
  for (const TypeTable& table : TypeTables()) version = std::max(version, table.since);
  return version;
}

Result<void> CheckSchema(Database& database) {
  const Result<std::int64_t> version = database.Number("PRAGMA user_version");
  if (!version) return tl::unexpected(version.error());
  if (*version < 0 || *version > kVersionMax) {
    return Fail(ErrorCode::kCorrupt,
                "database " + database.path() + " is damaged: its version is " + std::to_string(*version));
  }
  if (*version > SchemaVersion()) return {};
  const Result<std::set<std::string>> present = StatementsOf(database);
  if (!present) return tl::unexpected(present.error());
  // A file without a version is new or another program's, unless it holds all that ours hold.
  const int expected_version = *version == 0 ? SchemaVersion() : static_cast<int>(*version);
  Result<std::unique_ptr<Database>> intact = Database::Open(":memory:");
  if (!intact) return tl::unexpected(intact.error());
  if (const Result<void> made = Upgrade(**intact, 0, expected_version); !made) return made;
  const Result<std::set<std::string>> expected = StatementsOf(**intact);
  if (!expected) return tl::unexpected(expected.error());
  const bool is_ours = std::includes(present->begin(), present->end(), expected->begin(), expected->end());
  if (is_ours == (*version != 0)) return {};
  return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: its schema is not that of version " +
                                       std::to_string(*version));
}

Result<void> Migrate(Database& database, int to) {
  const Result<std::int64_t> version = database.Number("PRAGMA user_version");
  if (!version) return tl::unexpected(version.error());
  if (*version == to) return {};
  if (*version > to) {
    return Fail(ErrorCode::kRefused, "database " + database.path() + " has schema version " + std::to_string(*version) +
                                         "; this program knows up to " + std::to_string(to) + ": start a newer moondb");
  }
  const Result<std::int64_t> table_count = database.Number("SELECT count(*) FROM sqlite_master");
  if (!table_count) return tl::unexpected(table_count.error());
  if (*version == 0 && *table_count != 0) {
    return Fail(ErrorCode::kRefused, "database " + database.path() + " is not one of moondb's");
  }
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  const Result<void> done = Upgrade(database, static_cast<int>(*version), to);
  return done ? transaction->Commit() : done;
}

}  // namespace moondb
