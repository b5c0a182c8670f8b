#include "actors/storage/role_history.h"

#include <string>

namespace moondb {

namespace {

Result<bool> IsNewest(Database& database, const std::string& content) {
  Query query = database.Prepare("SELECT content FROM role_history ORDER BY row_id DESC LIMIT 1");
  const Result<bool> row = query.Step();
  if (!row) return row;
  return *row && query.Bytes(0) == content;
}

}  // namespace

Result<void> SaveRoles(Database& database, const proto::RoleAssignment& roles) {
  const std::string content = roles.SerializeAsString();
  const Result<bool> is_newest = IsNewest(database, content);
  if (!is_newest) return tl::unexpected(is_newest.error());
  if (*is_newest) return {};
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  {
    Query insert = database.Prepare(
        "INSERT INTO role_history(term_number, leader, survivor, stamp_ns, content) VALUES(?, ?, ?, ?, ?)");
    insert << roles.term().number() << roles.leader() << roles.survivor() << roles.stamp_ns() << Blob{content};
    if (const Result<void> done = insert.Run(); !done) return done;
    Query forget =
        database.Prepare("DELETE FROM role_history WHERE row_id <= (SELECT max(row_id) FROM role_history) - ?");
    forget << kRoleHistoryMax;
    if (const Result<void> done = forget.Run(); !done) return done;
  }
  return transaction->Commit();
}

Result<proto::LoadRolesReply> LoadRoles(Database& database) {
  proto::LoadRolesReply reply;
  Query query = database.Prepare("SELECT content FROM role_history ORDER BY row_id");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return reply;
    if (!reply.add_history()->ParseFromString(std::string(query.Bytes(0)))) {
      return Fail(ErrorCode::kCorrupt, "database " + database.path() + ": a role assignment does not parse");
    }
  }
}

}  // namespace moondb
