#include "apps/common/valid_records.h"

#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {

ValidRecords::ValidRecords(Client& client, const proto::TeamConfig& team)
    : client_(client), authority_(RoleChainOptions(team)) {}

// All role assignments are read before the first other records: they decide which ones are valid.
Result<void> ValidRecords::ReadRoles() {
  proto::ReadRequest request;
  request.add_data_types(proto::ROLE_ASSIGNMENT);
  request.set_records_max(1024);
  const Result<void> read =
      client_.ReadAll(request, [this](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
        (void)authority_.Counts(FromProto(stored.key()), record);
        return {};
      });
  has_roles_ = read.has_value();
  return read;
}

Result<void> ValidRecords::ReadAll(const proto::ReadRequest& request, const Visit& visit) {
  if (!has_roles_) {
    if (const Result<void> read = ReadRoles(); !read) return read;
  }
  return client_.ReadAll(request, [&](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
    const RecordKey key = FromProto(stored.key());
    return authority_.Counts(key, record) ? visit(key, record) : Result<void>();
  });
}

}  // namespace moondb
