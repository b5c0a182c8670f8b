#include "model/quarantined_maps.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace moondb {

QuarantinedMaps::QuarantinedMaps(const QuarantineSet& quarantines) {
  quarantines.ForEach([this](const RecordKey&, const proto::MapQuarantine& quarantine) {
    const bool is_of_maps = quarantine.graph_part_case() == proto::MapQuarantine::GRAPH_PART_NOT_SET;
    if (is_of_maps) spans_[quarantine.agent_id()].emplace_back(quarantine.from_ns(), quarantine.to_ns());
  });
  for (auto& [agent, of_agent] : spans_) {
    std::sort(of_agent.begin(), of_agent.end());
    std::vector<std::pair<std::int64_t, std::int64_t>> joined;
    for (const auto& span : of_agent) {
      if (joined.empty() || span.first > joined.back().second) {
        joined.push_back(span);
      } else {
        joined.back().second = std::max(joined.back().second, span.second);
      }
    }
    of_agent = std::move(joined);
  }
}

bool QuarantinedMaps::ContainsAll(AgentId agent) const {
  const auto of_agent = spans_.find(agent);
  constexpr std::pair kAllTimes(std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
  return of_agent != spans_.end() && of_agent->second.front() == kAllTimes;
}

bool QuarantinedMaps::Contains(AgentId agent, std::int64_t timestamp_ns) const {
  const auto of_agent = spans_.find(agent);
  if (of_agent == spans_.end()) return false;
  const auto behind = std::upper_bound(of_agent->second.begin(), of_agent->second.end(),
                                       std::pair(timestamp_ns, std::numeric_limits<std::int64_t>::max()));
  return behind != of_agent->second.begin() && timestamp_ns <= std::prev(behind)->second;
}

}  // namespace moondb
