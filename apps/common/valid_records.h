// ValidRecords: reads an agent's records, without those that agents ignore because their author had no authority for
// them (model/record_authority.h). Not thread-safe.
#pragma once

#include <functional>

#include "client/client.h"
#include "model/record_authority.h"
#include "model/record_key.h"
#include "proto/team.pb.h"

namespace moondb {

class ValidRecords {
 public:
  using Visit = std::function<Result<void>(const RecordKey& key, const proto::Record& record)>;

  // Requires: `client` outlives the object.
  ValidRecords(Client& client, const proto::TeamConfig& team);

  // Calls `visit` for each valid record that the request selects. Stops at its first error, and returns it. Other
  // errors are those of Client::ReadAll.
  Result<void> ReadAll(const proto::ReadRequest& request, const Visit& visit);

 private:
  Result<void> ReadRoles();

  Client& client_;
  RecordAuthority authority_;
  bool has_roles_ = false;
};

}  // namespace moondb
