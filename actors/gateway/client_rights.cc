#include "actors/gateway/client_rights.h"

#include "model/rights_name.h"

namespace moondb {

proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request) {
  switch (request) {
    case proto::ControlRequest::kStatus:
    case proto::ControlRequest::kRead:
    case proto::ControlRequest::kRoleShow:
    case proto::ControlRequest::kShareStatus:
    case proto::ControlRequest::kGraphStats:
    case proto::ControlRequest::kTrace:
    case proto::ControlRequest::kHave:
    case proto::ControlRequest::kVerify:
    case proto::ControlRequest::kFingerprint:
    case proto::ControlRequest::kMerge:
    case proto::ControlRequest::kMapWhy:
    case proto::ControlRequest::kMapStats:
    case proto::ControlRequest::kMapTiles:
    case proto::ControlRequest::kReadBundle:
      return proto::CLIENT_RIGHTS_VIEW;
    case proto::ControlRequest::kInsert:
    case proto::ControlRequest::kShare:
    case proto::ControlRequest::kLease:
    case proto::ControlRequest::kOptimize:
    case proto::ControlRequest::kCustom:
      return proto::CLIENT_RIGHTS_SHARE;
    case proto::ControlRequest::kRoleSet:
    case proto::ControlRequest::kStop:
    case proto::ControlRequest::kPrune:
    case proto::ControlRequest::kDownlink:
    case proto::ControlRequest::kAcknowledge:
    case proto::ControlRequest::REQUEST_NOT_SET:
      break;
  }
  return proto::CLIENT_RIGHTS_COMMAND;
}

Result<void> CheckClientRights(const proto::Message& message) {
  const proto::ClientRights needed = RightsNeededFor(message.control_request().request_case());
  const proto::ClientRights has = message.client_rights();
  if (has >= needed) return {};
  if (has == proto::CLIENT_RIGHTS_NONE) return Fail(ErrorCode::kRefused, "your key is no longer listed at this agent");
  return Fail(ErrorCode::kRefused, "this needs the right to " + RightsName(needed) + "; the key of " +
                                       message.client_name() + " has the right to " + RightsName(has));
}

}  // namespace moondb
