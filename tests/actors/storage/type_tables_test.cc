// Tests that the database has a table with the right columns for each built-in type in model/data_types.h.
#include "actors/storage/type_tables.h"

#include <gmock/gmock.h>

#include "actors/storage/record_validator.h"
#include "actors/storage/schema.h"
#include "model/data_types.h"
#include "model/text.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/sample_record.h"

namespace moondb {
namespace {

using testing::ElementsAreArray;
using testing::SizeIs;

// Returns the table's own columns, for example "celsius REAL". Leaves out the columns that all tables have.
std::vector<std::string> ColumnsIn(Database& database, const std::string& table) {
  std::vector<std::string> columns;
  Query query = database.Prepare("SELECT name || ' ' || type FROM pragma_table_info('" + table +
                                 "') WHERE cid > (SELECT cid FROM pragma_table_info('" + table +
                                 "') WHERE name = 'hash') AND name <> 'content' ORDER BY cid");
  for (Result<bool> row = query.Step(); row && *row; row = query.Step()) columns.emplace_back(query.Bytes(0));
  return columns;
}

// Returns the declared columns with name and SQL type only: "celsius REAL" for "celsius REAL NOT NULL".
std::vector<std::string> DeclaredColumns(const TypeTable& table) {
  std::vector<std::string> columns;
  for (const std::string_view column : Split(table.columns, ',')) {
    const std::vector<std::string_view> words = Split(column.substr(column.find_first_not_of(' ')), ' ');
    columns.push_back(std::string(words[0]) + " " + std::string(words[1]));
  }
  return columns;
}

TEST(TypeTablesTest, HaveARowForEachDataType) {
  std::vector<DataType> types;
  for (const TypeTable& table : TypeTables()) types.push_back(table.type);
  EXPECT_EQ(types, BuiltInDataTypes()) << "actors/storage/type_tables.cc and model/data_types.cc differ";
}

// Without the condition, the leader would send the records about all rovers to each rover.
TEST(TypeTablesTest, StateWhichAgentARecordNamesIfTheLeaderSendsItThere) {
  for (const TypeTable& table : TypeTables()) {
    EXPECT_EQ(!table.agent_condition.empty(), FindDataType(table.type)->leader_sends == LeaderSends::kToAgentNamed)
        << "TypeTable::agent_condition of " << DataTypeName(table.type);
  }
}

TEST(TypeTablesTest, ExistInTheDatabaseAsTheirRowsDeclare) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(MakeSchema(*database));
  for (const TypeTable& table : TypeTables()) {
    EXPECT_THAT(ColumnsIn(*database, DataTypeName(table.type)), ElementsAreArray(DeclaredColumns(table)))
        << "the table of " << DataTypeName(table.type);
  }
}

TEST(TypeTablesTest, ArePartOfTheViewsOverAllTypes) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(MakeSchema(*database));
  for (const TypeTable& table : TypeTables()) {
    const std::string from = " FROM " + DataTypeName(table.type) + " ";
    EXPECT_EQ(*database->Number("SELECT count(*) FROM sqlite_master WHERE name = 'shared_record' AND instr(sql, '" +
                                from + "') > 0"),
              1)
        << DataTypeName(table.type);
  }
}

TEST(TypeTablesTest, PreserveARecordOfEachTypeSentToAnotherStore) {
  TemporaryFolder folder;
  for (const DataTypeRow& row : DataTypeRows()) {
    const std::string name = DataTypeName(row.type);
    SCOPED_TRACE(name);
    auto options = StoreOptionsOf(1, folder.File(name + "_1.db"), 1);
    auto other_options = StoreOptionsOf(2, folder.File(name + "_2.db"), 1);
    options.policies[row.type] = other_options.policies[row.type] = row.share;
    const auto store = OpenStore(options);
    const auto other = OpenStore(other_options);
    proto::Record record = SampleRecord(row.type, 1);
    record.set_is_state(row.share == proto::POLICY_LATEST);
    EXPECT_GT(InsertOne(*store, record, false).seq(), 0u);
    EXPECT_TRUE(Transfer(*store, *other, 10));
    for (RecordStore* held : {store.get(), other.get()}) {
      const std::vector<proto::StoredRecord> contents = Contents(*held);
      ASSERT_THAT(contents, SizeIs(1));
      EXPECT_EQ(contents[0].key().data_type(), row.type);
      EXPECT_EQ(contents[0].content(), SerializeRecord(record));
      EXPECT_EQ(*held->database().Number("SELECT count(*) FROM " + name), 1);
      EXPECT_EQ(*held->database().Number("SELECT count(*) FROM replica"), 1);
    }
  }
}

}  // namespace
}  // namespace moondb
