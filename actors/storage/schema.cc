#include "actors/storage/schema.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "actors/storage/type_tables.h"
#include "model/data_types.h"

namespace moondb {

namespace {

constexpr char kCommonTables[] = R"sql(
CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE team_agent(agent_id INTEGER PRIMARY KEY) STRICT;
CREATE TABLE have_interval(
  origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL, is_dropped INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL, hash INTEGER NOT NULL,
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
  timestamp_ns INTEGER NOT NULL, content BLOB NOT NULL, hash INTEGER NOT NULL) STRICT;
CREATE TABLE own_epoch(epoch INTEGER PRIMARY KEY, hash INTEGER NOT NULL) STRICT;
CREATE TABLE written(day INTEGER PRIMARY KEY, bytes INTEGER NOT NULL) STRICT;
CREATE TABLE downlink_bundle(
  number INTEGER PRIMARY KEY, made_ns INTEGER NOT NULL, record_count INTEGER NOT NULL, bytes INTEGER NOT NULL,
  hash INTEGER NOT NULL, have BLOB NOT NULL, file BLOB) STRICT;
CREATE TABLE history(
  data_type INTEGER NOT NULL, row_id INTEGER NOT NULL, epoch INTEGER, seq INTEGER, timestamp_ns INTEGER NOT NULL,
  latest_key ANY NOT NULL, hash INTEGER NOT NULL, fields TEXT NOT NULL, content BLOB NOT NULL,
  PRIMARY KEY(data_type, row_id)) STRICT, WITHOUT ROWID;
INSERT INTO meta VALUES('next_row_id', 1);
)sql";

// The key of a custom record may be any bytes, so its column is not TEXT. The payload is stored once, in `content`.
constexpr char kCustomTables[] = R"sql(
CREATE TABLE custom_type(data_type INTEGER PRIMARY KEY, name TEXT NOT NULL) STRICT;
CREATE TABLE custom_record(
  row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, timestamp_ns INTEGER NOT NULL,
  latest_key BLOB NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,
  data_type INTEGER NOT NULL, metadata TEXT NOT NULL, payload_at INTEGER NOT NULL, payload_bytes INTEGER NOT NULL,
  content BLOB NOT NULL,
  payload BLOB GENERATED ALWAYS AS (substr(content, payload_at + 1, payload_bytes)) VIRTUAL,
  CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, data_type, seq)) STRICT;
CREATE INDEX custom_record_latest ON custom_record(latest_key, data_type, origin);
)sql";

// A node's pose is the newest optimized pose, or the raw pose if there is none. If several records have one natural
// key, the record with the smallest key is valid. `(x < 0), x` orders signed columns as the unsigned numbers of the
// same bits.
constexpr char kViews[] = R"sql(
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
  SELECT raw.node_agent, raw.node_index, raw.timestamp_ns, best.row_id IS NOT NULL AS is_optimized,
    COALESCE(best.x, raw.x) AS x, COALESCE(best.y, raw.y) AS y, COALESCE(best.z, raw.z) AS z,
    COALESCE(best.qx, raw.qx) AS qx, COALESCE(best.qy, raw.qy) AS qy, COALESCE(best.qz, raw.qz) AS qz,
    COALESCE(best.qw, raw.qw) AS qw
  FROM raw LEFT JOIN best
    ON best.node_agent = raw.node_agent AND best.node_index = raw.node_index AND best.place = 1
  WHERE raw.place = 1;

CREATE VIEW v_custom_record AS
  SELECT r.row_id, r.data_type, COALESCE(t.name, 'type_' || r.data_type) AS type, r.origin AS agent_id,
    CASE WHEN r.seq IS NOT NULL THEN printf('%d.%016x.%d.%d', r.origin, r.epoch, r.data_type, r.seq) END AS record_id,
    r.timestamp_ns, r.latest_key, r.metadata, r.payload
  FROM custom_record r LEFT JOIN custom_type t ON t.data_type = r.data_type;

CREATE VIEW v_event AS
  SELECT row_id, origin AS agent_id, timestamp_ns,
    CASE kind WHEN 1 THEN 'started' WHEN 2 THEN 'command' WHEN 3 THEN 'roles' WHEN 4 THEN 'restart'
      WHEN 5 THEN 'sharing' WHEN 6 THEN 'rejected' WHEN 7 THEN 'damage' WHEN 8 THEN 'lost' WHEN 9 THEN 'stopped'
      WHEN 10 THEN 'acknowledged' ELSE 'unknown' END AS kind, text, given_by
  FROM agent_event;
)sql";

// $TYPE is replaced by SQL that returns the name of a row's type.
constexpr char kHistoryView[] = R"sql(
CREATE VIEW v_history AS
  SELECT h.row_id, h.data_type, $TYPE AS type, own.value AS agent_id,
    CASE WHEN h.seq IS NOT NULL THEN printf('%d.%016x.%d.%d', own.value, h.epoch, h.data_type, h.seq) END AS record_id,
    h.timestamp_ns, h.latest_key, h.fields,
    substr(h.content, json_extract(h.fields, '$.payload_at') + 1, json_extract(h.fields, '$.payload_bytes')) AS payload
  FROM history h CROSS JOIN meta own LEFT JOIN custom_type t ON t.data_type = h.data_type
  WHERE own.name = 'own_agent';
)sql";

// SQL before and after the columns of a built-in type.
constexpr char kTableHead[] = R"sql((
  row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, timestamp_ns INTEGER NOT NULL,
  latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,
  )sql";
constexpr char kTableEnd[] = R"sql(,
  content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
)sql";

// Returns SQL for the table of a built-in type and the indexes over its keys.
std::string TableSql(const TypeTable& table) {
  const std::string name = DataTypeName(table.type);
  std::string sql = "CREATE TABLE " + name + kTableHead + table.columns + kTableEnd;
  const auto add_index = [&](const std::string& key) {
    sql += "CREATE INDEX " + name + "_" + key + " ON " + name + "(" + key + "_key, origin);\n";
  };
  const DataTypeRow& row = *FindDataType(table.type);
  if (row.natural_key != nullptr) add_index("natural");
  if (row.latest_key != nullptr) add_index("latest");
  return sql;
}

// Returns SQL for the view over all records that are marked for sharing.
std::string SharedRecordSql() {
  std::string sql = "CREATE VIEW shared_record AS";
  const auto add = [&sql](const std::string& type, const std::string& table) {
    sql += "\n  SELECT " + type + ", row_id, origin, epoch, seq, timestamp_ns FROM " + table + " WHERE seq IS NOT NULL";
  };
  for (const TypeTable& table : TypeTables()) {
    add(std::to_string(table.type) + " AS data_type", DataTypeName(table.type));
    sql += " UNION ALL";
  }
  add("data_type", "custom_record");
  return sql + ";\n";
}

std::string HistoryViewSql() {
  std::string type = "CASE h.data_type";
  for (const TypeTable& table : TypeTables()) {
    type += " WHEN " + std::to_string(table.type) + " THEN '" + DataTypeName(table.type) + "'";
  }
  type += " ELSE COALESCE(t.name, 'type_' || h.data_type) END";
  std::string sql = kHistoryView;
  const std::string name = "$TYPE";
  return sql.replace(sql.find(name), name.size(), type);
}

std::string SchemaSql() {
  std::string sql = kCommonTables;
  for (const TypeTable& table : TypeTables()) sql += TableSql(table);
  return sql + kCustomTables + SharedRecordSql() + kViews + HistoryViewSql();
}

// A store version above this limit means that the header is damaged. moondb will never have so many versions.
constexpr std::int64_t kVersionMax = 10'000;

// The identity in a file's header, and the number of its tables, indexes and views.
struct Identity {
  std::int64_t application_id = 0;
  std::int64_t version = 0;
  std::int64_t statement_count = 0;

  bool IsNew() const { return application_id == 0 && version == 0 && statement_count == 0; }
  bool IsStore() const { return application_id == kStoreApplicationId; }
};

Result<Identity> IdentityOf(Database& database) {
  Identity identity;
  for (const auto& [sql, number] : {std::pair("PRAGMA application_id", &identity.application_id),
                                    std::pair("PRAGMA user_version", &identity.version),
                                    std::pair("SELECT count(*) FROM sqlite_master", &identity.statement_count)}) {
    const Result<std::int64_t> read = database.Number(sql);
    if (!read) return tl::unexpected(read.error());
    *number = *read;
  }
  return identity;
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

// Returns whether the schema has all statements of this version. Ignores additional statements, which belong to the
// user.
Result<bool> HasAllStatements(Database& database) {
  const Result<std::set<std::string>> present = StatementsOf(database);
  if (!present) return tl::unexpected(present.error());
  Result<std::unique_ptr<Database>> intact = Database::Open(":memory:");
  if (!intact) return tl::unexpected(intact.error());
  if (const Result<void> made = (*intact)->Execute(SchemaSql()); !made) return tl::unexpected(made.error());
  const Result<std::set<std::string>> expected = StatementsOf(**intact);
  if (!expected) return tl::unexpected(expected.error());
  return std::includes(present->begin(), present->end(), expected->begin(), expected->end());
}

tl::unexpected<Error> Damaged(const Database& database, const std::string& what) {
  return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: " + what);
}

tl::unexpected<Error> Refused(const Database& database, const std::string& why) {
  return Fail(ErrorCode::kRefused,
              "database " + database.path() + why + "; it is not touched; move it away to begin an empty store");
}

}  // namespace

Result<void> CheckSchema(Database& database) {
  const Result<Identity> identity = IdentityOf(database);
  if (!identity) return tl::unexpected(identity.error());
  if (identity->IsNew()) return {};
  const std::string version = std::to_string(identity->version);
  if (identity->IsStore() && (identity->version <= 0 || identity->version > kVersionMax)) {
    return Damaged(database, "its store version is " + version);
  }
  if (identity->IsStore() && identity->version != kStoreVersion) {
    return Refused(database, " has store version " + version + ", and this moondb opens version " +
                                 std::to_string(kStoreVersion) + ": start the moondb that wrote it");
  }
  const Result<bool> has_all = HasAllStatements(database);
  if (!has_all) return tl::unexpected(has_all.error());
  if (identity->IsStore()) {
    return *has_all ? Result<void>() : Damaged(database, "its schema is not that of store version " + version);
  }
  if (*has_all) return Damaged(database, "its application id is not a store's");
  return Refused(database, " is no store of a released moondb (application id " +
                               std::to_string(identity->application_id) + ", version " + version + ")");
}

Result<void> MakeSchema(Database& database) {
  const Result<Identity> identity = IdentityOf(database);
  if (!identity) return tl::unexpected(identity.error());
  if (!identity->IsNew()) return {};
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  const Result<void> made =
      database.Execute(SchemaSql() + "PRAGMA application_id=" + std::to_string(kStoreApplicationId) +
                       "; PRAGMA user_version=" + std::to_string(kStoreVersion));
  return made ? transaction->Commit() : made;
}

}  // namespace moondb
