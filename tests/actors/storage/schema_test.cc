#include "actors/storage/schema.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "actors/storage/record_store.h"
#include "model/text.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

std::string Golden(const std::string& name) {
  const auto text = ReadTextFile(std::string(MOONDB_SOURCE_DIR) + "/tests/actors/storage/golden/" + name);
  EXPECT_TRUE(text) << ToString(text.error());
  return text ? *text : "";
}

// Returns all SQL statements in the database's schema, one per line, sorted by name.
std::string SchemaOf(Database& database) {
  std::string schema;
  Query query = database.Prepare("SELECT name || ': ' || sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name");
  for (Result<bool> row = query.Step(); row && *row; row = query.Step()) schema += std::string(query.Bytes(0)) + "\n";
  return schema;
}

std::unique_ptr<Database> NewStore() {
  auto database = *Database::Open(":memory:");
  EXPECT_TRUE(MakeSchema(*database));
  return database;
}

TEST(SchemaTest, DeclaresTheSchemaOfStoreVersion6) {
  EXPECT_EQ(SchemaOf(*NewStore()), Golden("schema_v6.txt"))
      << "stores of version 6 lie on robots' disks: another schema is another version (docs/COMPATIBILITY.md)";
  EXPECT_EQ(kStoreVersion, 6) << "each version has its golden file here";
}

TEST(SchemaTest, InitialisesANewFileOnce) {
  auto database = *Database::Open(":memory:");
  EXPECT_TRUE(CheckSchema(*database)) << "a new file";
  ASSERT_TRUE(MakeSchema(*database));
  EXPECT_EQ(*database->Number("PRAGMA application_id"), kStoreApplicationId);
  EXPECT_EQ(*database->Number("PRAGMA user_version"), kStoreVersion);
  EXPECT_EQ(*database->Number("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'temperature'"), 1);
  ASSERT_TRUE(MakeSchema(*database));
  EXPECT_TRUE(CheckSchema(*database));
}

TEST(SchemaTest, DetectsADamagedStatement) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  auto database = *Database::Open(path);
  ASSERT_TRUE(MakeSchema(*database));
  ASSERT_TRUE(database->Execute("CREATE VIEW my_own AS SELECT 1"));
  EXPECT_TRUE(CheckSchema(*database));
  const std::string damage =
      "PRAGMA writable_schema=ON; UPDATE sqlite_master SET sql = replace(sql, 'substr', 'sub\x7f') "
      "WHERE name = 'custom_record'; PRAGMA writable_schema=OFF";
  EXPECT_FALSE(database->Execute(damage)) << "not by what the store runs";
  database.reset();
  RunSql(path, damage);
  // SQLite itself may detect the damage.
  const auto damaged = Database::Open(path);
  EXPECT_EQ(damaged ? CheckSchema(**damaged).error().code : damaged.error().code, ErrorCode::kCorrupt);
}

TEST(SchemaTest, DetectsADamagedHeader) {
  for (const char* damage : {"PRAGMA user_version=-7", "PRAGMA user_version=0", "PRAGMA user_version=10001",
                             "PRAGMA application_id=0", "PRAGMA application_id=1836019567"}) {
    auto database = NewStore();
    ASSERT_TRUE(database->Execute(damage));
    EXPECT_EQ(CheckSchema(*database).error().code, ErrorCode::kCorrupt) << damage;
  }
}

TEST(SchemaTest, RefusesAStoreOfAnotherVersionAndNamesBoth) {
  for (const char* version : {"4", "7"}) {
    auto database = NewStore();
    ASSERT_TRUE(
        database->Execute(std::string("CREATE TABLE of_that_version(a INTEGER); PRAGMA user_version=") + version));
    const Result<void> refused = CheckSchema(*database);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
    const std::string expected =
        std::string("has store version ") + version + ", and this moondb opens the versions 5 to 6";
    EXPECT_NE(refused.error().text.find(expected), std::string::npos) << refused.error().text;
  }
}

TEST(SchemaTest, RefusesAnotherProgramsFile) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(database->Execute("CREATE TABLE notes(text TEXT); PRAGMA user_version=7"));
  const Result<void> refused = CheckSchema(*database);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_NE(refused.error().text.find("was not written by"), std::string::npos) << refused.error().text;
  ASSERT_TRUE(MakeSchema(*database));
  EXPECT_EQ(*database->Number("SELECT count(*) FROM sqlite_master"), 1);
  EXPECT_EQ(*database->Number("PRAGMA user_version"), 7);
}

// Tests files at the store's path that RecordStore refuses to open. A refusal must not change the file or its
// write-ahead log.
class RefusedFileTest : public testing::Test {
 protected:
  void ExpectRefusedAndNotTouched() {
    const std::string before = Bytes("");
    const std::string log_before = Bytes("-wal");
    const auto store = RecordStore::Open(StoreOptionsOf(2, path_));
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::kRefused) << ToString(store.error());
    EXPECT_NE(store.error().text.find("it was not changed"), std::string::npos) << store.error().text;
    EXPECT_EQ(Bytes(""), before);
    EXPECT_EQ(Bytes("-wal"), log_before);
    EXPECT_FALSE(std::filesystem::exists(path_ + ".damaged-1"));
  }

  std::string Bytes(const std::string& ending) const {
    const auto bytes = ReadTextFile(path_ + ending);
    return bytes ? *bytes : "";
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.File("store.sqlite");
};

TEST_F(RefusedFileTest, IsAStoreOfANewerVersion) {
  {
    auto store = OpenStore(StoreOptionsOf(2, path_));
    InsertOne(*store, TemperatureRecord(1));
    ASSERT_TRUE(store->database().Execute("PRAGMA user_version=7"));
    store->database().LeaveAsItIs();
  }
  ASSERT_FALSE(Bytes("-wal").empty()) << "what its last process wrote is still in the log";
  ExpectRefusedAndNotTouched();
}

TEST_F(RefusedFileTest, IsAnotherProgramsFile) {
  auto database = *Database::Open(path_);
  ASSERT_TRUE(database->Execute("PRAGMA journal_mode=DELETE; CREATE TABLE notes(text TEXT)"));
  database.reset();
  ASSERT_TRUE(Bytes("-wal").empty());
  ExpectRefusedAndNotTouched();
}

}  // namespace
}  // namespace moondb
