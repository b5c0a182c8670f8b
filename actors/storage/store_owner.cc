#include "actors/storage/store_owner.h"

#include <string>
#include <string_view>

namespace moondb {
namespace {

// Returns whether all data that WriteOwner would write is stored already.
Result<bool> IsWritten(Database& database, const std::set<AgentId>& team, const CustomTypes& types) {
  std::string agents;
  for (const AgentId agent : team) agents += (agents.empty() ? "" : ",") + std::to_string(agent);
  const Result<std::int64_t> is_same = database.Number(
      "SELECT (SELECT count(*) FROM meta WHERE name = 'own_agent') "
      "AND (SELECT group_concat(agent_id) FROM (SELECT agent_id FROM team_agent ORDER BY agent_id)) IS '" +
      agents + "' AND (SELECT count(*) FROM custom_type) = " + std::to_string(types.size()));
  if (!is_same) return tl::unexpected(is_same.error());
  if (*is_same == 0) return false;
  for (const proto::CustomType& type : types) {
    Query query = database.Prepare("SELECT 1 FROM custom_type WHERE data_type = ? AND name = ?");
    query << type.id() << std::string_view(type.name());
    if (Result<bool> row = query.Step(); !row || !*row) return row;
  }
  return true;
}

}  // namespace

Result<bool> CheckOwner(Database& database, AgentId self) {
  const Result<std::int64_t> owner = database.Number("SELECT value FROM meta WHERE name = 'own_agent'");
  if (!owner && owner.error().code == ErrorCode::kNotFound) return false;
  if (!owner) return tl::unexpected(owner.error());
  if (*owner == self) return true;
  return Fail(ErrorCode::kRefused, "database " + database.path() + " belongs to agent " + std::to_string(*owner) +
                                       ", not to agent " + std::to_string(self));
}

Result<void> WriteOwner(Database& database, AgentId self, const std::set<AgentId>& team, const CustomTypes& types) {
  const Result<bool> is_written = IsWritten(database, team, types);
  if (!is_written) return tl::unexpected(is_written.error());
  if (*is_written) return {};
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  std::string sql = "INSERT OR IGNORE INTO meta VALUES('own_agent', " + std::to_string(self) + ");";
  sql += "DELETE FROM team_agent;";
  for (const AgentId agent : team) sql += "INSERT INTO team_agent VALUES(" + std::to_string(agent) + ");";
  sql += "DELETE FROM custom_type;";
  if (const Result<void> done = database.Execute(sql); !done) return done;
  for (const proto::CustomType& type : types) {
    Query query = database.Prepare("INSERT INTO custom_type VALUES(?, ?)");
    query << type.id() << std::string_view(type.name());
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return transaction->Commit();
}

}  // namespace moondb
