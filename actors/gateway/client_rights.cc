#include "actors/gateway/client_rights.h"

#include "model/control_request.h"
#include "model/rights_name.h"

namespace moondb {

proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request) {
  const proto::ClientRights rights = CommandOptionsOf(request).rights();
  return rights == proto::CLIENT_RIGHTS_NONE ? proto::CLIENT_RIGHTS_COMMAND : rights;
}

Result<void> CheckClientRights(const proto::Message& message, proto::ControlRequest::RequestCase request) {
  const proto::ClientRights needed = RightsNeededFor(request);
  const proto::ClientRights has = message.client_rights();
  if (has >= needed) return {};
  if (has == proto::CLIENT_RIGHTS_NONE) return Fail(ErrorCode::kRefused, "your key is no longer listed at this agent");
  return Fail(ErrorCode::kRefused, "this needs the right to " + RightsName(needed) + "; the key of " +
                                       message.client_name() + " has the right to " + RightsName(has));
}

}  // namespace moondb
