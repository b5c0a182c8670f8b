// QuarantinedMaps: the maps that standing quarantines leave out, as ranges of timestamps of each agent. Copies from the
// set at construction. Value type.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "model/quarantine_set.h"
#include "model/record_key.h"

namespace moondb {

class QuarantinedMaps {
 public:
  QuarantinedMaps() = default;
  explicit QuarantinedMaps(const QuarantineSet& quarantines);

  // Returns whether a quarantine covers maps of `agent` with this timestamp. Ignores quarantines of a graph part.
  bool Contains(AgentId agent, std::int64_t timestamp_ns) const;
  // Returns whether quarantines cover all maps of `agent`, whatever their timestamps.
  bool ContainsAll(AgentId agent) const;

 private:
  std::map<AgentId, std::vector<std::pair<std::int64_t, std::int64_t>>> spans_;  // Disjoint and sorted.
};

}  // namespace moondb
