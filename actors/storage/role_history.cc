#include "actors/storage/role_history.h"

#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <cstdint>
#include <string>
#include <utility>

#include "actors/storage/record_tables.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

std::uint64_t HashOf(const std::string& content) { return XXH64(content.data(), content.size(), 0); }

Result<bool> IsNewest(Database& database, const std::string& content) {
  Query query = database.Prepare("SELECT content FROM role_history ORDER BY row_id DESC LIMIT 1");
  const Result<bool> row = query.Step();
  if (!row) return row;
  return *row && query.Bytes(0) == content;
}

}  // namespace

Result<bool> AddRoles(Database& database, const proto::RoleAssignment& roles) {
  const std::string content = roles.SerializeAsString();
  const Result<bool> is_newest = IsNewest(database, content);
  if (!is_newest) return tl::unexpected(is_newest.error());
  if (*is_newest) return false;
  Query insert = database.Prepare(
      "INSERT INTO role_history(term_number, leader, survivor, timestamp_ns, content, hash) VALUES(?, ?, ?, ?, ?, ?)");
  insert << roles.term().number() << roles.leader() << roles.survivor() << roles.timestamp_ns() << Blob{content}
         << HashOf(content);
  if (const Result<void> done = insert.Run(); !done) return tl::unexpected(done.error());
  Query forget =
      database.Prepare("DELETE FROM role_history WHERE row_id <= (SELECT max(row_id) FROM role_history) - ?");
  forget << kRoleHistoryMax;
  if (const Result<void> done = forget.Run(); !done) return tl::unexpected(done.error());
  return true;
}

Result<proto::LoadRolesReply> LoadRoles(Database& database) {
  proto::LoadRolesReply reply;
  Query query = database.Prepare("SELECT content, hash FROM role_history ORDER BY row_id");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return reply;
    const std::string content(query.Bytes(0));
    proto::RoleAssignment roles;
    if (query.Unsigned(1) == HashOf(content) && roles.ParseFromString(content)) {
      *reply.add_history() = std::move(roles);
    } else {
      spdlog::error("storage: a role assignment in {} is damaged and excluded", database.path());
    }
  }
}

Result<std::vector<proto::RoleAssignment>> LoadRoleRecords(Database& database) {
  std::vector<proto::RoleAssignment> assignments;
  Query query = FindRecordTable(proto::ROLE_ASSIGNMENT)->ReadAfter(database, 0);
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return assignments;
    proto::Record record;
    // Skip a damaged record; RowAudit reports it.
    const proto::StoredRecord stored = FindRecordTable(proto::ROLE_ASSIGNMENT)->Read(query);
    if (record.ParseFromString(stored.content())) assignments.push_back(std::move(*record.mutable_role_assignment()));
  }
}

}  // namespace moondb
