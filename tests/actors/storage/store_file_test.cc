#include "actors/storage/store_file.h"

#include <gmock/gmock.h>

#include <fstream>

#include "actors/storage/sqlite_database.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;

class StoreFileTest : public testing::Test {
 protected:
  StoreFileTest() {
    database_ = *Database::Open(file_.string());
    EXPECT_TRUE(
        database_->Execute("CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL);"
                           "INSERT INTO meta VALUES('incarnation', 7), ('own_agent', 2);"
                           "CREATE TABLE t(a INTEGER, b TEXT, c BLOB, d REAL);"
                           "INSERT INTO t VALUES(1, 'one', x'00ff', 0.5), (2, NULL, NULL, NULL)"));
  }

  const TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "a.sqlite";
  std::unique_ptr<Database> database_;  // The agent's own connection, open throughout the test.
};

TEST_F(StoreFileTest, AnswersQueriesWhileTheAgentWrites) {
  const auto answer = QueryStore(file_, "SELECT * FROM t ORDER BY a;", 10);
  ASSERT_TRUE(answer.has_value()) << ToString(answer.error());
  EXPECT_THAT(answer->columns, ElementsAre("a", "b", "c", "d"));
  ASSERT_EQ(answer->rows.size(), 2u);
  EXPECT_EQ(answer->rows[0][0].text, "1");
  EXPECT_EQ(answer->rows[0][0].kind, QueryCell::Kind::kNumber);
  EXPECT_EQ(answer->rows[0][1].text, "one");
  EXPECT_EQ(answer->rows[0][2].text, "00ff");
  EXPECT_EQ(answer->rows[0][2].kind, QueryCell::Kind::kBlob);
  EXPECT_EQ(answer->rows[0][3].text, "0.5");
  EXPECT_EQ(answer->rows[1][1].kind, QueryCell::Kind::kNull);
  EXPECT_FALSE(answer->is_cut);
  EXPECT_TRUE(QueryStore(file_, "SELECT * FROM t", 1)->is_cut);
  ASSERT_TRUE(database_->Execute("INSERT INTO t VALUES(3, '', NULL, 1e99)"));
  EXPECT_EQ(QueryStore(file_, "SELECT count(*) FROM t", 1)->rows[0][0].text, "3");
}

TEST_F(StoreFileTest, RefusesStatementsThatAreNotReadOnlyQueries) {
  for (const char* sql : {"DELETE FROM t", "SELECT 1; DELETE FROM t", "PRAGMA user_version = 9", "", "SELEC 1",
                          "ATTACH 'x.sqlite' AS x", "VACUUM", "CREATE TABLE u(a)", "BEGIN EXCLUSIVE"}) {
    const auto answer = QueryStore(file_, sql, 10);
    ASSERT_FALSE(answer.has_value()) << sql;
    EXPECT_EQ(answer.error().code, ErrorCode::kInvalid) << sql;
  }
  EXPECT_EQ(QueryStore(file_, "SELECT count(*) FROM t", 1)->rows[0][0].text, "2");
}

TEST_F(StoreFileTest, AbortsAQueryThatDoesNotEnd) {
  const auto endless =
      QueryStore(file_, "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT max(x) FROM c", 1,
                 [] { return true; });
  ASSERT_FALSE(endless.has_value());
  EXPECT_EQ(endless.error().code, ErrorCode::kTimedOut);
}

TEST_F(StoreFileTest, ReportsAFileThatIsNoStore) {
  EXPECT_EQ(QueryStore(folder_.path() / "none", "SELECT 1", 1).error().code, ErrorCode::kNotFound);
  std::ofstream(folder_.path() / "text") << std::string(5000, 'x');
  EXPECT_EQ(QueryStore(folder_.path() / "text", "SELECT * FROM t", 1).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(BackUpStore(folder_.path() / "text", folder_.path() / "copy").error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "copy"));
}

TEST_F(StoreFileTest, CopiesTheWholeStoreAndOverwritesNoFile) {
  const std::filesystem::path copy = folder_.path() / "copy.sqlite";
  const Result<void> done = BackUpStore(file_, copy);
  ASSERT_TRUE(done) << ToString(done.error());
  EXPECT_EQ(std::filesystem::status(copy).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  EXPECT_EQ(QueryStore(copy, "SELECT b FROM t WHERE a = 1", 1)->rows[0][0].text, "one");
  EXPECT_EQ(QueryStore(copy, "SELECT name FROM meta", 9)->rows.size(), 1u) << "another incarnation";
  EXPECT_EQ(QueryStore(file_, "SELECT name FROM meta", 9)->rows.size(), 2u);
  EXPECT_EQ(BackUpStore(file_, copy).error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(BackUpStore(file_, folder_.path() / "no" / "folder").has_value());
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.path().string().find(".part"), std::string::npos);
  }
}

}  // namespace
}  // namespace moondb
