#include "runtime/transport/link_order.h"

#include <algorithm>

namespace moondb {

bool LinkOrder::IsNewest(AgentId agent, std::uint32_t link_number) {
  Links& links = links_[agent];
  if (links.newest == link_number) return true;
  // A number shortly below the newest one belongs to an earlier connection of the same process. A restarted agent
  // starts at another random number.
  const bool was_before = links.newest != 0 && links.newest - link_number <= kEarlierMax;
  if (was_before || std::ranges::find(links.earlier, link_number) != links.earlier.end()) return false;
  // A number shortly above an earlier one belongs to a later connection of the same process.
  const auto is_after = [link_number](std::uint32_t other) { return link_number - other <= kEarlierMax; };
  if (links.newest != 0 && !is_after(links.newest) && std::ranges::any_of(links.earlier, is_after)) ++links.returns;
  if (links.newest != 0) links.earlier.push_back(links.newest);
  if (links.earlier.size() > kEarlierMax) links.earlier.pop_front();
  links.newest = link_number;
  return true;
}

int LinkOrder::returns(AgentId agent) const {
  const auto links = links_.find(agent);
  return links == links_.end() ? 0 : links->second.returns;
}

}  // namespace moondb
