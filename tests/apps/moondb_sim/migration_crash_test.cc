#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "actors/storage/migration.h"
#include "actors/storage/record_store.h"
#include "actors/storage/schema.h"
#include "apps/moondb_sim/simulated_disk.h"
#include "model/text.h"

namespace moondb::simulation {
namespace {

constexpr char kPath[] = "a/moondb.sqlite";

RecordStore::Options OptionsOn(const SimulatedDisk& disk) {
  RecordStore::Options options;
  options.path = kPath;
  options.vfs = disk.name();
  options.self = 2;
  options.team = {1, 2, 9};
  return options;
}

class MigrationCrashTest : public testing::Test {
 protected:
  MigrationCrashTest() {
    const auto dump = ReadTextFile(std::string(MOONDB_SOURCE_DIR) + "/tests/actors/storage/golden/store_v5.sql");
    EXPECT_TRUE(dump) << ToString(dump.error());
    const auto database = *Database::Open(kPath, 0, disk_.name());
    const Result<void> done = database->Execute(*dump);
    EXPECT_TRUE(done) << ToString(done.error());
    map_count_ = *database->Number("SELECT count(*) FROM local_traversability_map");
    pose_count_ = *database->Number("SELECT count(*) FROM optimized_pose");
  }

  // Returns the version of the file, which must be intact.
  std::int64_t Version() {
    const auto database = *Database::Open(kPath, 0, disk_.name());
    const Result<void> checked = CheckSchema(*database);
    EXPECT_TRUE(checked) << ToString(checked.error());
    EXPECT_EQ(*database->Number("SELECT count(*) FROM local_traversability_map"), map_count_);
    EXPECT_EQ(*database->Number("SELECT count(*) FROM optimized_pose"), pose_count_);
    return *database->Number("PRAGMA user_version");
  }

  SimulatedDisk disk_{1};
  std::int64_t map_count_ = 0;
  std::int64_t pose_count_ = 0;
};

TEST_F(MigrationCrashTest, LeavesTheOldOrTheNewStoreAtEachWrite) {
  const SimulatedDisk::Image old = disk_.Save("a/");
  bool is_cut = true;
  disk_.on_cut = [&is_cut](const std::string&) { is_cut = true; };
  int old_count = 0;
  int calls = 0;
  while (is_cut) {
    ASSERT_LT(++calls, 10'000);
    disk_.Wipe("a/");
    disk_.Restore("a/", old);
    is_cut = false;
    {
      const auto database = *Database::Open(kPath, 0, disk_.name());
      disk_.CutPowerAfter("a/", calls);
      const Result<void> migrated = MigrateStore(*database, 2);
      disk_.CutPowerAfter("a/", 0);
      EXPECT_TRUE(migrated.has_value() || is_cut) << calls << ": " << ToString(migrated.error());
      if (!is_cut) break;
    }
    const std::int64_t version = Version();
    EXPECT_TRUE(version == 5 || version == kStoreVersion) << "after " << calls << " writes: " << version;
    old_count += version == 5;
    const auto store = RecordStore::Open(OptionsOn(disk_));
    ASSERT_TRUE(store) << "after " << calls << " writes: " << ToString(store.error());
    EXPECT_EQ(*(*store)->database().Number("PRAGMA user_version"), kStoreVersion);
  }
  disk_.CutPower("a/");
  EXPECT_EQ(Version(), kStoreVersion) << "the migration is durable";
  EXPECT_GT(old_count, 10) << "the power was cut before the commit as well";
}

TEST_F(MigrationCrashTest, FailsOnAFullDiskAndKeepsTheOldStore) {
  disk_.SetRoom("a/", 0);
  const auto full = RecordStore::Open(OptionsOn(disk_));
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, ErrorCode::kFull) << ToString(full.error());
  disk_.SetRoom("a/", std::nullopt);
  EXPECT_EQ(Version(), 5);
  EXPECT_TRUE(RecordStore::Open(OptionsOn(disk_)));
}

TEST_F(MigrationCrashTest, FailsOnAFailingDiskAndKeepsTheOldStore) {
  disk_.SetFailing("a/", true);
  EXPECT_FALSE(RecordStore::Open(OptionsOn(disk_)));
  disk_.SetFailing("a/", false);
  EXPECT_EQ(Version(), 5);
}

}  // namespace
}  // namespace moondb::simulation
