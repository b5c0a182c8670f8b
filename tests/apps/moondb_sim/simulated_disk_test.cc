#include "apps/moondb_sim/simulated_disk.h"

#include <gtest/gtest.h>

#include <memory>

#include "actors/storage/sqlite_database.h"

namespace moondb::simulation {
namespace {

constexpr char kPath[] = "a/x.db";

std::unique_ptr<Database> Open(const SimulatedDisk& disk) { return *Database::Open(kPath, 0, disk.name()); }

Result<void> Insert(Database& database, int number, Database::Durability durability) {
  Result<Transaction> transaction = Transaction::Begin(database, durability);
  if (!transaction) return tl::unexpected(transaction.error());
  // Inserts two rows in one transaction. The disk must keep both or none.
  for (int i = 0; i < 2; ++i) {
    Query query = database.Prepare("INSERT INTO t VALUES(?)");
    query << number;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return transaction->Commit();
}

TEST(SimulatedDiskTest, KeepsWhatWasSyncedAndNoHalfTransaction) {
  int lost = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    SimulatedDisk disk(seed);
    int durable = 0;
    int begun = 0;
    {
      const auto database = Open(disk);
      ASSERT_TRUE(database->Execute("CREATE TABLE t(x INTEGER)"));
      disk.CutPowerAfter("a/", 1 + static_cast<int>(seed) % 40);
      for (int i = 1; i <= 20; ++i) {
        const bool is_full = i % 2 == 0;
        ++begun;
        if (!Insert(*database, i, is_full ? Database::Durability::kFull : Database::Durability::kNormal)) break;
        if (is_full) durable = i;
      }
      disk.CutPower("a/");
      // A database that was open at the power cut no longer works.
      EXPECT_FALSE(Insert(*database, 99, Database::Durability::kFull));
    }
    const auto database = Open(disk);
    ASSERT_TRUE(database->QuickCheck());
    const std::int64_t count = *database->Number("SELECT count(*) FROM t");
    const std::int64_t last = *database->Number("SELECT coalesce(max(x), 0) FROM t");
    EXPECT_EQ(count, 2 * last);
    EXPECT_GE(last, durable);
    EXPECT_LE(last, begun);
    lost += last < begun ? 1 : 0;
  }
  EXPECT_GT(lost, 20);
}

TEST(SimulatedDiskTest, GivesBackAnOlderCopyAndAnEmptyDisk) {
  SimulatedDisk disk(1);
  SimulatedDisk::Image image;
  {
    const auto database = Open(disk);
    ASSERT_TRUE(database->Execute("CREATE TABLE t(x INTEGER)"));
    ASSERT_TRUE(Insert(*database, 1, Database::Durability::kFull));
    image = disk.Save("a/");
    ASSERT_TRUE(Insert(*database, 2, Database::Durability::kFull));
  }
  disk.Restore("a/", image);
  EXPECT_EQ(*Open(disk)->Number("SELECT max(x) FROM t"), 1);
  disk.Wipe("a/");
  EXPECT_EQ(*Open(disk)->Number("SELECT count(*) FROM sqlite_master"), 0);
}

TEST(SimulatedDiskTest, DamageIsNoticed) {
  SimulatedDisk disk(1);
  {
    const auto database = Open(disk);
    ASSERT_TRUE(database->Execute("CREATE TABLE t(x INTEGER)"));
    for (int i = 0; i < 2000; ++i) ASSERT_TRUE(Insert(*database, i, Database::Durability::kNormal));
  }
  disk.Damage("a/");
  const auto opened = Database::Open(kPath, 0, disk.name());
  EXPECT_TRUE(!opened || !(*opened)->QuickCheck());
}

}  // namespace
}  // namespace moondb::simulation
