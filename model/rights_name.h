// Names of client rights.
#pragma once

#include <string>

#include "proto/clients.pb.h"

namespace moondb {

// Returns the name as in clients.yaml: "share".
inline std::string RightsName(proto::ClientRights rights) {
  switch (rights) {
    case proto::CLIENT_RIGHTS_VIEW:
      return "view";
    case proto::CLIENT_RIGHTS_SHARE:
      return "share";
    case proto::CLIENT_RIGHTS_COMMAND:
      return "command";
    default:
      return "none";
  }
}

}  // namespace moondb
