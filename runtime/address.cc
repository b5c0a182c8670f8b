#include "runtime/address.h"

namespace moondb {
namespace {

std::string AgentText(AgentId agent) {
  switch (agent) {
    case kLeaderAlias:
      return "@leader";
    case kSurvivorAlias:
      return "@survivor";
    case kBaseAlias:
      return "@base";
    case kClients:
      return "@clients";
    default:
      return std::to_string(agent);
  }
}

}  // namespace

std::string ToString(const Address& address) { return AgentText(address.agent) + "/" + address.actor; }

}  // namespace moondb
