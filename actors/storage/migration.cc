#include "actors/storage/migration.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "actors/storage/schema.h"
#include "actors/storage/schema_sql.h"
#include "actors/storage/store_file.h"
#include "actors/storage/store_owner.h"

namespace moondb {

namespace {

// Returns the statements of the user's own indexes and triggers. A migration removes those of the tables that it
// replaces.
Result<std::vector<std::pair<std::string, std::string>>> UsersStatements(Database& database, std::int64_t version) {
  const Result<std::set<std::string>> intact = IntactStatements(version);
  if (!intact) return tl::unexpected(intact.error());
  std::vector<std::pair<std::string, std::string>> statements;
  Query query = database.Prepare(
      "SELECT type || ' ' || name || ' ' || tbl_name || ' ' || sql, name, sql FROM sqlite_master "
      "WHERE type IN ('index', 'trigger') AND sql IS NOT NULL");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return statements;
    if (intact->contains(std::string(query.Bytes(0)))) continue;
    statements.emplace_back(query.Bytes(1), query.Bytes(2));
  }
}

Result<void> RestoreUsersStatements(Database& database,
                                    const std::vector<std::pair<std::string, std::string>>& statements) {
  std::set<std::string> present;
  {
    Query query = database.Prepare("SELECT name FROM sqlite_master");
    Result<bool> row = query.Step();
    for (; row && *row; row = query.Step()) present.emplace(query.Bytes(0));
    if (!row) return tl::unexpected(row.error());
  }
  for (const auto& [name, sql] : statements) {
    if (present.contains(name)) continue;
    if (const Result<void> made = database.Execute(sql); !made) return made;
  }
  return {};
}

// Copies a store beside itself before a migration: the only way back to the moondb that wrote it. Logs why there is no
// copy. A copy that an earlier, interrupted migration made stays.
void CopyBeforeMigration(Database& database) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(database.path(), error)) return;  // In memory, or simulated.
  const std::string copy = database.path() + ".before-version-" + std::to_string(kStoreVersion);
  if (std::filesystem::exists(copy, error)) return;
  const std::optional<DiskSpace> space = database.GetDiskSpace();
  const Result<std::uint64_t> used = database.UsedPageBytes();
  // The migration itself writes a part of the store twice.
  const bool has_room = used && space && space->free_bytes > 4 * *used;
  const Result<void> copied = has_room ? BackUpStore(database.path(), copy)
                                       : Result<void>(Fail(ErrorCode::kFull, "the disk has no space for the copy"));
  if (copied) {
    spdlog::info("storage: {}: copied to {} before the migration", database.path(), copy);
  } else {
    spdlog::warn("storage: {}: migrates without a copy: {}", database.path(), ToString(copied.error()));
  }
}

}  // namespace

Result<void> MigrateStore(Database& database, AgentId self) {
  const Result<bool> is_older = IsOfOlderVersion(database);
  if (!is_older) return tl::unexpected(is_older.error());
  if (!*is_older) return {};
  const Result<bool> has_owner = CheckOwner(database, self);
  if (!has_owner) return tl::unexpected(has_owner.error());
  CopyBeforeMigration(database);
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  const auto of_user = UsersStatements(database, kOldestStoreVersion);
  if (!of_user) return tl::unexpected(of_user.error());
  Result<void> done = database.Execute(From5To6Sql() + "PRAGMA user_version=" + std::to_string(kStoreVersion));
  if (done) done = RestoreUsersStatements(database, *of_user);
  if (done) done = transaction->Commit();
  if (done) spdlog::info("storage: {}: migrated to store version {}", database.path(), kStoreVersion);
  return done;
}

}  // namespace moondb
