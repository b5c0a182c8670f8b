#include "runtime/transport/link_routes.h"

#include <algorithm>
#include <utility>

namespace moondb {

bool LinkRoutes::IsNewest(AgentId agent, std::string_view route) {
  Routes& known = routes_[agent];
  if (known.newest == route) return true;
  if (std::find(known.earlier.begin(), known.earlier.end(), route) != known.earlier.end()) return false;
  known.earlier.push_back(std::exchange(known.newest, std::string(route)));
  if (known.earlier.size() > kEarlierMax) known.earlier.pop_front();
  return true;
}

}  // namespace moondb
