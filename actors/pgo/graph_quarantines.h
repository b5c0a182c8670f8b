// GraphQuarantines: the parts of the pose graph, and the maps behind map matches, that quarantines leave out
// (model/quarantine_set.h).
// Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "model/pose_graph.h"
#include "model/quarantine_set.h"
#include "model/quarantined_maps.h"
#include "model/record_key.h"

namespace moondb {

class GraphQuarantines {
 public:
  static constexpr std::size_t kRecordsMax = 65535;  // Quarantines and records that lift one.

  // Adds a quarantine, or a record that lifts one.
  void Add(const RecordKey& key, const proto::MapQuarantine& quarantine);

  bool HasNode(const NodeKey& node) const { return Standing().nodes.contains(node); }
  // Returns true if a quarantine names this factor, its source at its producer, or its producer. `record`: the record
  // of the factor.
  bool HasFactor(const RecordKey& record, const FactorKey& factor) const;
  // Returns true if a quarantine leaves out maps of `node` with this timestamp, or the node.
  bool HasMap(const NodeKey& node, std::int64_t timestamp_ns) const;
  std::size_t size() const { return Standing().count; }  // Number of quarantines of graph parts in force.
  // Number of records dropped because of the limit, by origin.
  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const { quarantines_.CountLeftOut(counts); }

 private:
  struct Parts {
    std::size_t count = 0;
    QuarantinedMaps maps;
    std::set<NodeKey> nodes;
    std::set<FactorKey> factors;
    std::set<std::pair<AgentId, std::string>> sources;  // An empty source stands for all sources of the producer.
  };

  const Parts& Standing() const;

  QuarantineSet quarantines_{kRecordsMax};
  mutable std::optional<Parts> standing_;  // Derived from `quarantines_` when needed.
};

}  // namespace moondb
