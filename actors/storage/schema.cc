#include "actors/storage/schema.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "actors/storage/schema_sql.h"

namespace moondb {

namespace {

// A store version above this limit means that the header is damaged. moondb will never have so many versions.
constexpr std::int64_t kVersionMax = 10'000;

// The identity in a file's header, and the number of its tables, indexes and views.
struct Identity {
  std::int64_t application_id = 0;
  std::int64_t version = 0;
  std::int64_t statement_count = 0;

  bool IsNew() const { return application_id == 0 && version == 0 && statement_count == 0; }
  bool IsStore() const { return application_id == kStoreApplicationId; }
};

Result<Identity> IdentityOf(Database& database) {
  Identity identity;
  for (const auto& [sql, number] : {std::pair("PRAGMA application_id", &identity.application_id),
                                    std::pair("PRAGMA user_version", &identity.version),
                                    std::pair("SELECT count(*) FROM sqlite_master", &identity.statement_count)}) {
    const Result<std::int64_t> read = database.Number(sql);
    if (!read) return tl::unexpected(read.error());
    *number = *read;
  }
  return identity;
}

Result<std::set<std::string>> StatementsOf(Database& database) {
  std::set<std::string> statements;
  Query query =
      database.Prepare("SELECT type || ' ' || name || ' ' || tbl_name || ' ' || coalesce(sql, '') FROM sqlite_master");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return statements;
    statements.emplace(query.Bytes(0));
  }
}

// Returns whether the schema has all statements of the version. Ignores additional statements, which belong to the
// user.
Result<bool> HasAllStatements(Database& database, std::int64_t version) {
  const Result<std::set<std::string>> present = StatementsOf(database);
  if (!present) return tl::unexpected(present.error());
  const Result<std::set<std::string>> expected = IntactStatements(version);
  if (!expected) return tl::unexpected(expected.error());
  return std::includes(present->begin(), present->end(), expected->begin(), expected->end());
}

tl::unexpected<Error> Damaged(const Database& database, const std::string& what) {
  return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: " + what);
}

tl::unexpected<Error> Refused(const Database& database, const std::string& why) {
  return Fail(ErrorCode::kRefused,
              "database " + database.path() + why + "; it was not changed; move it away to start with an empty store");
}

}  // namespace

Result<std::set<std::string>> IntactStatements(std::int64_t version) {
  Result<std::unique_ptr<Database>> intact = Database::Open(":memory:");
  if (!intact) return tl::unexpected(intact.error());
  const std::string sql = SchemaSql() + (version < 6 ? From6To5Sql() : "");
  if (const Result<void> made = (*intact)->Execute(sql); !made) return tl::unexpected(made.error());
  return StatementsOf(**intact);
}

Result<void> CheckSchema(Database& database) {
  const Result<Identity> identity = IdentityOf(database);
  if (!identity) return tl::unexpected(identity.error());
  if (identity->IsNew()) return {};
  const std::string version = std::to_string(identity->version);
  if (identity->IsStore() && (identity->version <= 0 || identity->version > kVersionMax)) {
    return Damaged(database, "its store version is " + version);
  }
  const bool is_known = identity->version >= kOldestStoreVersion && identity->version <= kStoreVersion;
  if (identity->IsStore() && !is_known) {
    return Refused(database, " has store version " + version + ", and this moondb opens the versions " +
                                 std::to_string(kOldestStoreVersion) + " to " + std::to_string(kStoreVersion) +
                                 ": start the moondb that wrote it");
  }
  const Result<bool> has_all = HasAllStatements(database, identity->IsStore() ? identity->version : kStoreVersion);
  if (!has_all) return tl::unexpected(has_all.error());
  if (identity->IsStore()) {
    return *has_all ? Result<void>() : Damaged(database, "its schema differs from that of store version " + version);
  }
  if (*has_all) return Damaged(database, "its application id is not that of a moondb store");
  return Refused(database, " was not written by a released moondb (application id " +
                               std::to_string(identity->application_id) + ", version " + version + ")");
}

Result<void> MakeSchema(Database& database) {
  const Result<Identity> identity = IdentityOf(database);
  if (!identity) return tl::unexpected(identity.error());
  if (!identity->IsNew()) return {};
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  const Result<void> made =
      database.Execute(SchemaSql() + "PRAGMA application_id=" + std::to_string(kStoreApplicationId) +
                       "; PRAGMA user_version=" + std::to_string(kStoreVersion));
  return made ? transaction->Commit() : made;
}

Result<bool> IsOfOlderVersion(Database& database) {
  const Result<Identity> identity = IdentityOf(database);
  if (!identity) return tl::unexpected(identity.error());
  return identity->IsStore() && identity->version < kStoreVersion;
}

}  // namespace moondb
