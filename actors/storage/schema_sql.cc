#include "actors/storage/schema_sql.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "actors/storage/type_tables.h"
#include "model/check.h"
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

CREATE VIEW v_custom_record AS
  SELECT r.row_id, r.data_type, COALESCE(t.name, 'type_' || r.data_type) AS type, r.origin AS agent_id,
    CASE WHEN r.seq IS NOT NULL THEN printf('%d.%016x.%d.%d', r.origin, r.epoch, r.data_type, r.seq) END AS record_id,
    r.timestamp_ns, r.latest_key, r.metadata, r.payload
  FROM custom_record r LEFT JOIN custom_type t ON t.data_type = r.data_type;
)sql";

// A node's pose is the newest optimized pose, or the raw pose if there is none. If several records have one natural
// key, the record with the smallest key is valid. `(x < 0), x` orders signed columns as the unsigned numbers of the
// same bits.
constexpr char kNodePoseView[] = R"sql(
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
    COALESCE(best.qw, raw.qw) AS qw, COALESCE(best.is_unplaced, 0) AS is_unplaced
  FROM raw LEFT JOIN best
    ON best.node_agent = raw.node_agent AND best.node_index = raw.node_index AND best.place = 1
  WHERE raw.place = 1;
)sql";

constexpr char kEventView[] = R"sql(
CREATE VIEW v_event AS
  SELECT row_id, origin AS agent_id, timestamp_ns,
    CASE kind WHEN 1 THEN 'started' WHEN 2 THEN 'command' WHEN 3 THEN 'roles' WHEN 4 THEN 'restart'
      WHEN 5 THEN 'sharing' WHEN 6 THEN 'rejected' WHEN 7 THEN 'damage' WHEN 8 THEN 'lost' WHEN 9 THEN 'stopped'
      WHEN 10 THEN 'acknowledged' WHEN 11 THEN 'pruned' ELSE 'unknown' END AS kind, text, given_by
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

// Returns SQL for an index of a built-in type's table.
std::string IndexSql(const std::string& table, const std::string& name, const std::string& columns) {
  return "CREATE INDEX " + table + "_" + name + " ON " + table + "(" + columns + ");\n";
}

// Returns SQL for the table of a built-in type and the indexes over its keys.
std::string TableWithKeysSql(DataType type, const std::string& columns) {
  const std::string name = DataTypeName(type);
  std::string sql = "CREATE TABLE " + name + kTableHead + columns + kTableEnd;
  const DataTypeRow& row = *FindDataType(type);
  if (row.natural_key != nullptr) sql += IndexSql(name, "natural", "natural_key, origin");
  if (row.latest_key != nullptr) sql += IndexSql(name, "latest", "latest_key, origin");
  return sql;
}

// Returns the tables with an index by time: those of types that are shared under `all` by default, of which a store
// holds many rows. An empty index takes a page of the file.
std::vector<std::string> TablesByTime() {
  std::vector<std::string> tables;
  for (const TypeTable& table : TypeTables()) {
    if (FindDataType(table.type)->share == proto::POLICY_ALL) tables.push_back(DataTypeName(table.type));
  }
  tables.emplace_back("custom_record");
  return tables;
}

std::string TimeIndexesSql() {
  std::string sql;
  for (const std::string& table : TablesByTime()) sql += IndexSql(table, "time", "timestamp_ns");
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

// A table that version 6 changes.
struct ChangedTable {
  DataType type;
  std::string columns_5;  // The type's columns in version 5.
  const char* added;      // Columns that version 6 adds, with a comma before each.
  const char* values;     // The values of `added` for rows of version 5, with a comma before each.
};

constexpr char kVersionColumns5[] =
    "term_number INTEGER NOT NULL, term_issuer INTEGER NOT NULL, term_issuer_epoch INTEGER NOT NULL, "
    "run INTEGER NOT NULL";
constexpr char kPoseColumns5[] =
    "x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,"
    "qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL";

std::vector<ChangedTable> ChangedTables() {
  return {{proto::POWER, "battery_ratio REAL NOT NULL, draw_w REAL NOT NULL", "", ""},
          {proto::OPTIMIZED_POSE,
           std::string("node_agent INTEGER NOT NULL, node_index INTEGER NOT NULL, ") + kVersionColumns5 + ", " +
               kPoseColumns5,
           ", is_unplaced", ", 0"}};
}

// A record of version 5 without a charge has the column's value 0, as has a charge of 0.
constexpr char kUnknownCharges[] = R"sql(
UPDATE power SET battery_ratio = NULL WHERE battery_ratio = 0;
UPDATE history SET fields = json_set(fields, '$.battery_ratio', NULL)
  WHERE data_type = 2 AND json_extract(fields, '$.battery_ratio') = 0;
)sql";

// The views that version 6 changes. Version 5 has them without these parts.
constexpr char kDropChangedViews[] = "DROP VIEW v_node_pose; DROP VIEW v_event;\n";
constexpr std::string_view kAddedToNodePose = ", COALESCE(best.is_unplaced, 0) AS is_unplaced";
constexpr std::string_view kAddedToEvent = " WHEN 11 THEN 'pruned'";

std::string Without(std::string text, std::string_view part) {
  const std::size_t place = text.find(part);
  Check(place != std::string::npos, "the part is in the text");
  return text.erase(place, part.size());
}

const TypeTable& TableOf(DataType type) {
  const std::vector<TypeTable>& tables = TypeTables();
  return *std::find_if(tables.begin(), tables.end(), [type](const TypeTable& table) { return table.type == type; });
}

// Returns SQL that makes a table of version 5 one of version 6. Copies the rows twice instead of renaming the table,
// because SQLite would rename it in the user's views as well.
std::string ChangeTableSql(const ChangedTable& changed) {
  const std::string name = DataTypeName(changed.type);
  std::string columns = "row_id, origin, epoch, seq, timestamp_ns, latest_key, natural_key, hash, content";
  for (const std::string& column : ColumnNames(changed.columns_5)) columns += ", " + column;
  return "CREATE TABLE migrated AS SELECT * FROM " + name + ";\nDROP TABLE " + name + ";\n" +
         TableWithKeysSql(changed.type, TableOf(changed.type).columns) + "INSERT INTO " + name + "(" + columns +
         changed.added + ") SELECT " + columns + changed.values + " FROM migrated;\nDROP TABLE migrated;\n";
}

}  // namespace

std::string SchemaSql() {
  std::string sql = kCommonTables;
  for (const TypeTable& table : TypeTables()) sql += TableWithKeysSql(table.type, table.columns);
  return sql + kCustomTables + TimeIndexesSql() + SharedRecordSql() + kNodePoseView + kViews + kEventView +
         HistoryViewSql();
}

std::string From5To6Sql() {
  std::string sql = kDropChangedViews;
  for (const ChangedTable& changed : ChangedTables()) sql += ChangeTableSql(changed);
  return sql + TimeIndexesSql() + kUnknownCharges + kNodePoseView + kEventView;
}

std::string From6To5Sql() {
  std::string sql = kDropChangedViews;
  for (const std::string& table : TablesByTime()) sql += "DROP INDEX " + table + "_time;\n";
  for (const ChangedTable& changed : ChangedTables()) {
    sql += "DROP TABLE " + DataTypeName(changed.type) + ";\n" + TableWithKeysSql(changed.type, changed.columns_5);
  }
  return sql + Without(kNodePoseView, kAddedToNodePose) + Without(kEventView, kAddedToEvent);
}

}  // namespace moondb
