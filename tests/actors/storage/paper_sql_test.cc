#include "actors/storage/paper_sql.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cmath>
#include <random>

#include "model/record_check.h"
#include "model/record_hash.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

const RecordKey kKey{{3, 0x5F3C9A1E0B7D4C21u, proto::TEMPERATURE}, 17};

proto::StoredRecord Store(const proto::Record& record, std::uint64_t seq = 17) {
  const RecordKey key{{3, 0x5F3C9A1E0B7D4C21u, TypeOf(record)}, seq};
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  stored.set_content(record.SerializeAsString());
  stored.set_hash(HashRecord(key, stored.content()));
  return stored;
}

void ExpectComesBack(const proto::Record& record) {
  const proto::StoredRecord stored = Store(record);
  const std::optional<std::string> sql = SqlOf(stored);
  ASSERT_TRUE(sql) << record.ShortDebugString();
  const auto back = RecordOf(*sql, FromProto(stored.key()));
  ASSERT_TRUE(back) << ToString(back.error()) << *sql;
  EXPECT_EQ(back->SerializeAsString(), stored.SerializeAsString());
}

// Sets every field of the message to random values. Each repeated field gets two entries.
void Fill(Message& message, std::mt19937_64& rng, int depth = 0) {
  const auto& all = *message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message.GetDescriptor()->field(i);
    if (field->containing_oneof() != nullptr && field->containing_oneof()->field(0) != field) continue;
    for (int left = field->is_repeated() ? 2 : 1; left > 0; --left) {
      const bool is_one = !field->is_repeated();
      switch (field->cpp_type()) {
        case FieldDescriptor::CPPTYPE_DOUBLE: {
          const double value = std::ldexp(static_cast<double>(rng() >> 11), static_cast<int>(rng() % 120) - 110);
          is_one ? all.SetDouble(&message, field, -value) : all.AddDouble(&message, field, value);
          break;
        }
        case FieldDescriptor::CPPTYPE_UINT32:
          is_one ? all.SetUInt32(&message, field, static_cast<std::uint32_t>(rng()))
                 : all.AddUInt32(&message, field, static_cast<std::uint32_t>(rng()));
          break;
        case FieldDescriptor::CPPTYPE_INT64:
          is_one ? all.SetInt64(&message, field, static_cast<std::int64_t>(rng()))
                 : all.AddInt64(&message, field, static_cast<std::int64_t>(rng()));
          break;
        case FieldDescriptor::CPPTYPE_UINT64:
          is_one ? all.SetUInt64(&message, field, rng()) : all.AddUInt64(&message, field, rng());
          break;
        case FieldDescriptor::CPPTYPE_BOOL:
          is_one ? all.SetBool(&message, field, true) : all.AddBool(&message, field, true);
          break;
        case FieldDescriptor::CPPTYPE_ENUM:
          is_one ? all.SetEnumValue(&message, field, 1) : all.AddEnumValue(&message, field, 1);
          break;
        case FieldDescriptor::CPPTYPE_STRING:
          is_one ? all.SetString(&message, field, "it's \"quoted\"; --") : all.AddString(&message, field, "'");
          break;
        case FieldDescriptor::CPPTYPE_MESSAGE:
          if (depth < 4) {
            Fill(is_one ? *all.MutableMessage(&message, field) : *all.AddMessage(&message, field), rng, depth + 1);
          }
          break;
        default:
          break;
      }
    }
  }
}

TEST(PaperSqlTest, WritesARecordAsOneInsert) {
  proto::Record record = TemperatureRecord(-40.5);
  record.set_timestamp_ns(1700);
  EXPECT_EQ(SqlOf(Store(record)),
            "INSERT INTO temperature (record_id, agent_id, timestamp_ns, celsius) VALUES ('3.5f3c9a1e0b7d4c21.1.17', "
            "3, 1700, "
            "-40.5)");
}

TEST(PaperSqlTest, RestoresRecordsOfEveryType) {
  const unsigned seed = 5;
  std::mt19937_64 rng(seed);
  const auto* body = proto::Record::descriptor()->FindOneofByName("body");
  for (int i = 0; i < body->field_count(); ++i) {
    const FieldDescriptor* field = body->field(i);
    for (int round = 0; round < 20; ++round) {
      proto::Record record;
      record.set_timestamp_ns(static_cast<std::int64_t>(rng()));
      Message& message = *record.GetReflection()->MutableMessage(&record, field);
      if (round > 0) Fill(message, rng);
      if (record.has_custom()) record.mutable_custom()->set_data_type(1007);
      if (record.has_local_traversability_map()) record.mutable_local_traversability_map()->clear_layers();
      ExpectComesBack(record);
    }
  }
}

TEST(PaperSqlTest, RestoresMapsWithOneBytePerCell) {
  const proto::Record record = MapRecord({3, 1});
  ExpectComesBack(record);
  std::size_t cells = 0;
  for (const proto::MapLayer& layer : record.local_traversability_map().layers()) {
    cells += std::size_t{layer.width_cells()} * layer.height_cells();
  }
  ASSERT_GT(cells, 0u);
  EXPECT_GT(SqlOf(Store(record))->size(), 2 * cells);
}

TEST(PaperSqlTest, RestoresEmptyMessagesAndExtremeNumbers) {
  proto::Record record;
  record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m();
  ExpectComesBack(record);
  record.mutable_pose_graph_node()->mutable_node()->set_index(UINT64_MAX);
  for (const double value : {5e-324, 1.7976931348623157e308, 0.1, 1e300 / 3, 2.0, 1e22, -123456789012345680.0}) {
    record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m()->set_x(value);
    ExpectComesBack(record);
  }
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  for (int i = 0; i < 36; ++i) edge.mutable_relative_pose()->add_covariance(-2.2250738585072014e-308);
  ExpectComesBack(record);
}

TEST(PaperSqlTest, RestoresNumbersThatSqliteFirstParsesInexactly) {
  const unsigned seed = 7;
  SCOPED_TRACE(seed);
  std::mt19937_64 rng(seed);
  std::normal_distribution<double> draw(0, 100);
  for (int round = 0; round < 500; ++round) {
    proto::Record record;
    proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
    for (int i = 0; i < 21; ++i) edge.mutable_relative_pose()->add_covariance(draw(rng));
    ExpectComesBack(record);
  }
}

TEST(PaperSqlTest, RefusesToEncodeRecordsThatItCouldNotRestore) {
  proto::Record record = TemperatureRecord(std::nan(""));
  EXPECT_FALSE(SqlOf(Store(record)));
  record = TemperatureRecord(1);
  record.GetReflection()->MutableUnknownFields(&record)->AddVarint(200, 1);
  EXPECT_FALSE(SqlOf(Store(record)));
  proto::StoredRecord stored = Store(TemperatureRecord(1));
  stored.set_hash(stored.hash() + 1);
  EXPECT_FALSE(SqlOf(stored));
  stored = Store(TemperatureRecord(1));
  stored.mutable_key()->set_data_type(proto::POWER);
  EXPECT_FALSE(SqlOf(stored));
  stored.mutable_key()->set_data_type(999);
  EXPECT_FALSE(SqlOf(stored));
}

TEST(PaperSqlTest, AcceptsOnlyOneInsertOfTheAnnouncedRow) {
  const std::string columns = "INSERT INTO temperature (record_id, agent_id, celsius) ";
  const std::string row = "('" + ToString(kKey) + "', 3, 1.0)";
  ASSERT_TRUE(RecordOf(columns + "VALUES " + row, kKey));
  const std::string refused[] = {
      "",
      ";",
      "-- nothing",
      "SELECT 1",
      columns,
      columns + "VALUES " + row + "; DROP TABLE temperature",
      columns + "VALUES " + row + ", " + row,
      columns + "VALUES " + row + " RETURNING celsius",
      columns + "SELECT '" + ToString(kKey) + "', 3, 1.0",
      columns + "SELECT '" + ToString(kKey) + "', 3, name FROM sqlite_master",
      columns + "VALUES ('" + ToString(kKey) + "', 3, (SELECT 1))",
      columns + "VALUES ('" + ToString(kKey) + "', 3, abs(1))",
      columns + "VALUES ('" + ToString(kKey) + "', 3, zeroblob(1000000000))",
      columns + "VALUES ('" + ToString(kKey) + "', 3, randomblob(10))",
      columns + "VALUES ('" + ToString(kKey) + "', 3, load_extension('x'))",
      columns + "VALUES ('" + ToString(kKey) + "', 3, ?)",
      columns + "VALUES ('" + ToString(kKey) + "', 4, 1.0)",
      columns + "VALUES ('" + ToString(kKey) + "', '3', 1.0)",
      columns + "VALUES ('3.5f3c9a1e0b7d4c21.1.18', 3, 1.0)",
      columns + "DEFAULT VALUES",
      "INSERT INTO temperature (record_id, agent_id, secret) VALUES " + row,
      "INSERT INTO power (record_id, agent_id, draw_w) VALUES " + row,
      "INSERT INTO sqlite_master (name, tbl_name, rootpage) VALUES " + row,
      "UPDATE temperature SET celsius = 0",
      "DELETE FROM temperature",
      "REPLACE INTO sqlite_sequence VALUES " + row,
      "CREATE TABLE other (x)",
      "CREATE TRIGGER t AFTER INSERT ON temperature BEGIN SELECT 1; END",
      "ATTACH '/tmp/moondb_paper_sql_test' AS other",
      "PRAGMA writable_schema = 1",
      "VACUUM INTO '/tmp/moondb_paper_sql_test'",
      "BEGIN",
      "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT count(*) FROM c",
      columns + "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT '" + ToString(kKey) +
          "', 3, x FROM c",
      "EXPLAIN " + columns + "VALUES " + row,
  };
  for (const std::string& sql : refused) {
    const auto record = RecordOf(sql, kKey);
    ASSERT_FALSE(record) << sql;
    EXPECT_EQ(record.error().code, ErrorCode::kCorrupt) << sql;
  }
}

TEST(PaperSqlTest, BoundsTheCostOfAStatement) {
  const std::string begin =
      "INSERT INTO temperature (record_id, agent_id, celsius) VALUES ('" + ToString(kKey) + "', 3, ";
  std::string deep = "1";
  for (int i = 0; i < 1000; ++i) deep = "(" + deep + "+1)";
  EXPECT_FALSE(RecordOf(begin + deep + ")", kKey));
  EXPECT_FALSE(RecordOf(begin + "X'" + std::string(2 * kPaperSqlBytesMax, '0') + "')", kKey));
  EXPECT_FALSE(RecordOf(std::string(kPaperSqlBytesMax + 1, ' '), kKey));
  const RecordKey map_key{{3, 1, proto::LOCAL_TRAVERSABILITY_MAP}, 1};
  EXPECT_FALSE(RecordOf("INSERT INTO local_traversability_map (record_id, agent_id, layers_15_width_cells) VALUES ('" +
                            ToString(map_key) + "', 3, 1)",
                        map_key));
}

// SQLite would allocate a gigabyte for some of the statements in this test, and run for many seconds on others.
TEST(PaperSqlTest, RefusesLongStatementsBeforeSqliteReadsThem) {
  const auto long_one = [](std::string sql, const std::string& again) {
    while (sql.size() + again.size() < kPaperSqlBytesMax) sql += again;
    return sql;
  };
  const std::string begin = "INSERT INTO temperature (record_id, agent_id, celsius) VALUES ";
  const std::string statements[] = {
      long_one(begin + "(1, 1, 1)", ",(1)"),
      long_one(begin + "('''', 1, 1)", ",('''')"),
      long_one(begin + "(1", ",1"),
      long_one(begin + "(1 IN (1", ",1"),
      long_one(begin + "(abs(1", ",1"),
      long_one(begin + "(CASE", " WHEN 1 THEN 1"),
      long_one(begin + "(1, 1, 1) RETURNING 1", ",1"),
      long_one("INSERT INTO temperature (celsius", ",celsius"),
      long_one("INSERT INTO temperature (celsius) SELECT 1", " UNION SELECT 1"),
      // In these statements the single quote does not begin a string, so the check must count the commas behind the
      // quote.
      long_one(begin + "(\"'\"", ",1"),
      long_one(begin + "([']", ",1"),
      long_one(begin + "(`'`", ",1"),
      long_one(begin + "(--'\n1", ",1"),
      long_one(begin + "(/*'*/1", ",1"),
      long_one(begin + "($a(')", ",1"),
  };
  for (const std::string& sql : statements) {
    const std::string start = sql.substr(0, 80);
    sqlite3_memory_highwater(/*resetFlag=*/1);
    EXPECT_FALSE(RecordOf(sql, kKey)) << start;
    EXPECT_LT(sqlite3_memory_highwater(0), 1'000'000) << start;
  }
}

TEST(PaperSqlTest, SurvivesMutatedStatements) {
  const unsigned seed = 6;
  SCOPED_TRACE(seed);
  std::mt19937_64 rng(seed);
  const std::string sql = *SqlOf(Store(TemperatureRecord(-40.5)));
  for (int round = 0; round < 2000; ++round) {
    std::string changed = sql;
    for (int left = 1 + static_cast<int>(rng() % 3); left > 0; --left) {
      changed[rng() % changed.size()] = static_cast<char>(rng() % 2 == 0 ? rng() : "'\"(),;-*/0123456789"[rng() % 20]);
    }
    const auto record = RecordOf(changed, kKey);
    if (record) {
      EXPECT_EQ(FromProto(record->key()), kKey) << changed;
    }
  }
}

}  // namespace
}  // namespace moondb
