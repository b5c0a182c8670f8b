#include "actors/storage/sqlite_database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

TEST(SqliteDatabaseTest, KeepsUnsignedNumbersTextAndBytesBitForBit) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(database->Execute("CREATE TABLE t(a INTEGER, b TEXT, c BLOB, d REAL, e INTEGER)"));
  const std::string bytes("\0\xff\0x", 4);
  ASSERT_TRUE((database->Prepare("INSERT INTO t VALUES(?, ?, ?, ?, ?)")
               << UINT64_MAX << std::string_view("") << Blob{bytes} << 0.1 << nullptr)
                  .Run());
  Query query = database->Prepare("SELECT a, b IS NULL, c, d, e IS NULL FROM t");
  ASSERT_TRUE(*query.Step());
  EXPECT_EQ(query.Unsigned(0), UINT64_MAX);
  EXPECT_EQ(query.Integer(1), 0);
  EXPECT_EQ(query.Bytes(2), bytes);
  EXPECT_EQ(query.Real(3), 0.1);
  EXPECT_EQ(query.Integer(4), 1);
}

TEST(SqliteDatabaseTest, RollsBackAnUncommittedTransaction) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(database->Execute("CREATE TABLE t(a INTEGER)"));
  {
    Result<Transaction> transaction = Transaction::Begin(*database);
    ASSERT_TRUE(transaction);
    ASSERT_TRUE(database->Execute("INSERT INTO t VALUES(1)"));
  }
  EXPECT_EQ(*database->Number("SELECT count(*) FROM t"), 0);
}

TEST(SqliteDatabaseTest, RefusesAFileThatIsAlreadyOpen) {
  TemporaryFolder folder;
  auto first = *Database::Open(folder.File("a.db"));
  const auto second = Database::Open(folder.File("a.db"));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  first.reset();
  EXPECT_TRUE(Database::Open(folder.File("a.db")));
}

TEST(SqliteDatabaseTest, ReportsAFileThatIsNoDatabase) {
  TemporaryFolder folder;
  std::ofstream(folder.File("a.db")) << std::string(5000, 'x');
  const auto database = Database::Open(folder.File("a.db"));
  ASSERT_FALSE(database);
  EXPECT_EQ(database.error().code, ErrorCode::kCorrupt);
}

TEST(SqliteDatabaseTest, AbortsAStatementThatDoesNotEnd) {
  auto database = Database::Open(":memory:").value();
  ASSERT_TRUE(
      database->Execute("CREATE VIEW record AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
                        "SELECT x FROM c"));
  database->SetStepsMax(1'000'000);
  const Result<std::int64_t> counted = database->Number("SELECT count(*) FROM record");
  ASSERT_FALSE(counted);
  EXPECT_EQ(counted.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(counted.error().text, testing::HasSubstr("did not end"));
  EXPECT_EQ(database->Number("SELECT 7").value(), 7) << "each step has its own";
}

TEST(SqliteDatabaseTest, SetsDamagedFilesAsideAndRemovesTheSmallestBeyondALimit) {
  TemporaryFolder folder;
  const std::string path = folder.File("a.db");
  for (int number = 1; number <= Database::kDamagedMax; ++number) {
    std::ofstream(path) << (number == 3 ? "small" : "a larger file ") << number;
    std::ofstream(path + "-wal") << "log";
    const Result<std::string> aside = Database::SetAside(path);
    ASSERT_TRUE(aside) << ToString(aside.error());
    EXPECT_EQ(*aside, path + ".damaged-" + std::to_string(number));
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_TRUE(std::filesystem::exists(*aside + "-wal"));
  }
  std::ofstream(path) << "one more";
  const Result<std::string> last = Database::SetAside(path);
  ASSERT_TRUE(last) << ToString(last.error());
  EXPECT_EQ(*last, path + ".damaged-10");
  const auto content = [&path](int number) {
    std::ifstream file(path + ".damaged-" + std::to_string(number));
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(content(1), "a larger file 1");
  EXPECT_EQ(content(3), "a larger file 4");
  EXPECT_EQ(content(9), "a larger file 10");
  EXPECT_EQ(content(10), "one more");
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(SqliteDatabaseTest, ReportsAMissingFolder) {
  const auto database = Database::Open("/nonexistent/folder/a.db");
  ASSERT_FALSE(database);
  EXPECT_NE(database.error().text.find("/nonexistent/folder/a.db"), std::string::npos);
}

class DatabaseInPlaceTest : public testing::Test {
 protected:
  DatabaseInPlaceTest() {
    EXPECT_TRUE(database_->Execute("CREATE TABLE t(a BLOB)"));
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(Insert());
    EXPECT_TRUE(database_->Checkpoint());
    EXPECT_TRUE(Insert());
  }

  Result<void> Insert() {
    Result<Transaction> transaction = Transaction::Begin(*database_);
    if (!transaction) return tl::unexpected(transaction.error());
    if (const Result<void> done = database_->Execute("INSERT INTO t VALUES(randomblob(5000))"); !done) return done;
    return transaction->Commit();
  }

  void ExpectNoticed(const std::string& what) {
    const Result<void> done = Insert();
    ASSERT_FALSE(done) << "a commit into a file that nobody finds is acknowledged";
    EXPECT_EQ(done.error().code, ErrorCode::kCorrupt);
    EXPECT_NE(done.error().text.find(what), std::string::npos) << done.error().text;
  }

  TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_.File("a.sqlite");
  std::unique_ptr<Database> database_ = *Database::Open(path_);
};

TEST_F(DatabaseInPlaceTest, DetectsARemovedFile) {
  std::filesystem::remove(path_);
  ExpectNoticed("was removed or moved");
}

TEST_F(DatabaseInPlaceTest, DetectsAReplacedFileAndKeepsItsLog) {
  std::filesystem::rename(path_, folder_.File("elsewhere"));
  std::ofstream(path_) << "another";
  std::ofstream(path_.string() + "-wal.other") << "its log";
  std::filesystem::rename(path_.string() + "-wal.other", path_.string() + "-wal");
  ExpectNoticed("was replaced by another file");
  database_.reset();
  EXPECT_EQ(std::filesystem::file_size(path_.string() + "-wal"), 7u);
}

TEST_F(DatabaseInPlaceTest, DetectsATruncatedFile) {
  std::filesystem::resize_file(path_, 3 * 4096);
  ExpectNoticed("was cut");
}

TEST_F(DatabaseInPlaceTest, DetectsARemovedLog) {
  std::filesystem::remove(path_.string() + "-wal");
  ExpectNoticed("-wal, was removed");
}

TEST_F(DatabaseInPlaceTest, AcceptsAVacuumedFile) {
  ASSERT_TRUE(database_->Execute("DELETE FROM t"));
  ASSERT_TRUE(database_->Execute("VACUUM"));
  ASSERT_TRUE(database_->Checkpoint());
  EXPECT_TRUE(Insert());
}

}  // namespace
}  // namespace moondb
