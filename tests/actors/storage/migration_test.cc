#include "actors/storage/migration.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <string>

#include "actors/storage/record_store.h"
#include "actors/storage/schema.h"
#include "model/text.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::HasSubstr;

constexpr AgentId kOwner = 2;  // The agent whose store the dump of version 5 is.

std::string Golden(const std::string& name) {
  const auto text = ReadTextFile(std::string(MOONDB_SOURCE_DIR) + "/tests/actors/storage/golden/" + name);
  EXPECT_TRUE(text) << ToString(text.error());
  return text ? *text : "";
}

// Returns the first column of each row, one per line.
std::string Rows(Database& database, const std::string& sql) {
  std::string rows;
  Query query = database.Prepare(sql);
  Result<bool> row = query.Step();
  for (; row && *row; row = query.Step()) rows += std::string(query.Bytes(0)) + "\n";
  EXPECT_TRUE(row) << ToString(row.error());
  return rows;
}

std::string SchemaOf(Database& database) {
  return Rows(database, "SELECT name || ': ' || sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name");
}

class MigrationTest : public testing::Test {
 protected:
  void SetUp() override { RunSql(path_, Golden("store_v5.sql")); }

  TemporaryFolder folder_;
  const std::string path_ = folder_.File("moondb.sqlite");
};

TEST_F(MigrationTest, KeepsEveryRecordByteForByte) {
  std::map<std::string, std::string> before;
  {
    const auto database = *Database::Open(path_);
    for (const RecordTable& table : RecordTables()) {
      before[table.name()] =
          Rows(*database, "SELECT row_id || ' ' || hash || ' ' || hex(content) FROM " + table.name());
    }
  }
  EXPECT_THAT(before["local_traversability_map"], HasSubstr("\n"));
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  EXPECT_TRUE(store->damage().empty());
  EXPECT_EQ(*store->database().Number("PRAGMA user_version"), kStoreVersion);
  EXPECT_EQ(SchemaOf(store->database()), Golden("schema_v6.txt"));
  for (const RecordTable& table : RecordTables()) {
    EXPECT_EQ(Rows(store->database(), "SELECT row_id || ' ' || hash || ' ' || hex(content) FROM " + table.name() +
                                          (table.name() == "agent_event" ? " WHERE row_id < 61" : "")),
              before[table.name()])
        << table.name();
  }
}

TEST_F(MigrationTest, MakesAChargeOfZeroUnknown) {
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  EXPECT_EQ(Rows(store->database(), "SELECT coalesce(battery_ratio, 'unknown') || ' ' || draw_w FROM power"),
            "unknown 13.0\n");
  EXPECT_EQ(Rows(store->database(),
                 "SELECT coalesce(json_extract(fields, '$.battery_ratio'), 'unknown') FROM history WHERE data_type = 2 "
                 "ORDER BY row_id"),
            "unknown\n0.5\n");
}

TEST_F(MigrationTest, PlacesOldOptimizedPoses) {
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  EXPECT_EQ(*store->database().Number("SELECT sum(is_unplaced) FROM v_node_pose WHERE is_optimized"), 0);
  EXPECT_GT(*store->database().Number("SELECT count(*) FROM v_node_pose WHERE is_optimized"), 0);
}

TEST_F(MigrationTest, CopiesTheStoreBefore) {
  ASSERT_NE(OpenStore(StoreOptionsOf(kOwner, path_)), nullptr);
  const auto copy = *Database::Open(path_ + ".before-version-6");
  EXPECT_EQ(*copy->Number("PRAGMA user_version"), 5);
  EXPECT_EQ(SchemaOf(*copy), Golden("schema_v5.txt"));
  EXPECT_GT(*copy->Number("SELECT count(*) FROM local_traversability_map"), 0);
}

TEST_F(MigrationTest, KeepsIndexesTriggersAndViewsOfTheUser) {
  RunSql(path_,
         "CREATE INDEX my_power ON power(draw_w); CREATE VIEW my_view AS SELECT draw_w FROM power;"
         "CREATE TRIGGER my_trigger AFTER INSERT ON optimized_pose BEGIN SELECT 1; END;");
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  EXPECT_EQ(*store->database().Number("SELECT count(*) FROM sqlite_master WHERE name LIKE 'my_%'"), 3);
  EXPECT_EQ(Rows(store->database(), "SELECT draw_w FROM my_view"), "13.0\n");
}

TEST_F(MigrationTest, LeavesAnotherAgentsStoreAlone) {
  EXPECT_EQ(RecordStore::Open(StoreOptionsOf(1, path_)).error().code, ErrorCode::kRefused);
  EXPECT_EQ(*(*Database::Open(path_))->Number("PRAGMA user_version"), 5);
  EXPECT_FALSE(std::filesystem::exists(path_ + ".before-version-6"));
}

TEST_F(MigrationTest, DetectsDamageOfTheOldSchema) {
  RunSql(path_, "DROP VIEW v_event");
  const auto database = *Database::Open(path_);
  EXPECT_EQ(CheckSchema(*database).error().code, ErrorCode::kCorrupt);
}

// Records that clients may not insert any more: timestamps from 0, and variances of 1e10, 1e300 and 1e-13.
TEST_F(MigrationTest, SharesRecordsThatAreRefusedFromNowOn) {
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  const auto leader = OpenStore(StoreOptionsOf(1));
  while (Transfer(*store, *leader)) {
  }
  for (const std::string table : {"pose_graph_node", "pose_graph_edge", "pose_prior", "local_traversability_map"}) {
    const std::string sql = "SELECT hex(content) FROM " + table + " WHERE origin = 2 ORDER BY epoch, seq";
    EXPECT_NE(Rows(store->database(), sql), "");
    EXPECT_EQ(Rows(leader->database(), sql), Rows(store->database(), sql)) << table;
  }
  for (const proto::VerifyPart part : {proto::VERIFY_PART_FILE, proto::VERIFY_PART_ROWS, proto::VERIFY_PART_HELD}) {
    proto::VerifyRequest request;
    request.set_part(part);
    const Result<proto::VerifyReply> reply = leader->Verify(request);
    ASSERT_TRUE(reply) << ToString(reply.error());
    EXPECT_EQ(reply->damaged_count() + reply->missing_count() + reply->orphaned_count(), 0);
    EXPECT_TRUE(reply->findings().empty());
  }
}

TEST_F(MigrationTest, OpensTheMigratedStoreAgain) {
  ASSERT_NE(OpenStore(StoreOptionsOf(kOwner, path_)), nullptr);
  const auto store = OpenStore(StoreOptionsOf(kOwner, path_));
  ASSERT_NE(store, nullptr);
  InsertOne(*store, TemperatureRecord(3));
}

}  // namespace
}  // namespace moondb
