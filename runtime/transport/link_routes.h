// LinkRoutes: which connection of an agent is the present one, told by the routing ids that this side's ROUTER gives to
// connections, and by the agent that CURVE says each belongs to. What a connection claims to be plays no part.
//
// An agent that connects anew leaves a connection behind that may not have been seen to die, and messages of it that
// are still on their way here.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <string_view>

#include "model/ids.h"

namespace moondb {

class LinkRoutes {
 public:
  // A frame came from `agent` on `route`: whether that is its newest connection.
  bool IsNewest(AgentId agent, std::string_view route);

 private:
  static constexpr std::size_t kEarlierMax = 16;  // More than an agent may have at a time (DoorGuard).

  struct Routes {
    std::string newest;
    std::deque<std::string> earlier;
  };
  std::map<AgentId, Routes> routes_;
};

}  // namespace moondb
