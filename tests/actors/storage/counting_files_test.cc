#include "actors/storage/counting_files.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "actors/storage/sqlite_database.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

std::unique_ptr<Database> Open(const std::string& path) {
  auto database = Database::Open(path);
  EXPECT_TRUE(database) << ToString(database.error());
  return database ? *std::move(database) : nullptr;
}

TEST(CountingFilesTest, CountsBytesWrittenToFileAndLog) {
  const TemporaryFolder folder;
  const auto database = Open(folder.File("a.db"));
  ASSERT_TRUE(database->Execute("CREATE TABLE t(x BLOB)"));
  const std::uint64_t before = database->WrittenBytes();
  ASSERT_TRUE(database->Execute("INSERT INTO t VALUES(zeroblob(100000))"));
  const std::uint64_t in_log = database->WrittenBytes() - before;
  EXPECT_GE(in_log, 100'000u);
  EXPECT_LE(in_log, 130'000u);
  ASSERT_TRUE(database->Execute("PRAGMA wal_checkpoint(TRUNCATE)"));
  const std::uint64_t in_file = database->WrittenBytes() - before - in_log;
  EXPECT_GE(in_file, 100'000u);
  EXPECT_LE(in_file, 130'000u);
}

TEST(CountingFilesTest, ReadingCountsNoBytes) {
  const TemporaryFolder folder;
  const auto database = Open(folder.File("a.db"));
  ASSERT_TRUE(database->Execute("CREATE TABLE t(x); INSERT INTO t VALUES(1)"));
  const std::uint64_t before = database->WrittenBytes();
  EXPECT_EQ(*database->Number("SELECT x FROM t"), 1);
  EXPECT_EQ(database->WrittenBytes(), before);
}

TEST(CountingFilesTest, CountsEachDatabaseSeparately) {
  const TemporaryFolder folder;
  const auto first = Open(folder.File("a.db"));
  const auto second = Open(folder.File("b.db"));
  const std::uint64_t before = second->WrittenBytes();
  ASSERT_TRUE(first->Execute("CREATE TABLE t(x)"));
  EXPECT_GT(first->WrittenBytes(), 0u);
  EXPECT_EQ(second->WrittenBytes(), before);
}

// Debian's SQLite overwrites deleted content with zeros by default. Database sets secure_delete to FAST, which avoids
// these extra writes.
TEST(CountingFilesTest, DeletingWritesFewerBytesThanItRemoves) {
  const TemporaryFolder folder;
  const auto database = Open(folder.File("a.db"));
  ASSERT_TRUE(database->Execute("CREATE TABLE t(x BLOB); INSERT INTO t VALUES(zeroblob(1000000))"));
  const std::uint64_t before = database->WrittenBytes();
  ASSERT_TRUE(database->Execute("DELETE FROM t"));
  EXPECT_LT(database->WrittenBytes() - before, 100'000u);
}

}  // namespace
}  // namespace moondb
