// GraphQuarantines: the quarantines of parts of the pose graph that no record lifts.
//
// The result depends only on the set of added records, not on their order. Beyond the limit, the agents with the most
// quarantines keep only their newest (model/origin_quota.h). Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "model/origin_quota.h"
#include "model/pose_graph.h"
#include "model/record_key.h"

namespace moondb {

class GraphQuarantines {
 public:
  static constexpr std::size_t kRecordsMax = 65535;  // Quarantines and records that lift one.

  // Adds a quarantine, or a record that lifts one. Ignores quarantines of maps.
  void Add(const RecordKey& key, const proto::MapQuarantine& quarantine);

  bool HasNode(const NodeKey& node) const { return Standing().nodes.contains(node); }
  // Returns true if a quarantine names this factor, its source at its producer, or its producer. `record`: the record
  // of the factor.
  bool HasFactor(const RecordKey& record, const FactorKey& factor) const;
  std::size_t size() const { return Standing().count; }  // Number of quarantines in force.
  // Number of records dropped because of the limit, by origin.
  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const { quota_.CountLeftOut(counts); }

 private:
  struct Parts {
    std::size_t count = 0;
    std::set<NodeKey> nodes;
    std::set<FactorKey> factors;
    std::set<std::pair<AgentId, std::string>> sources;  // An empty source stands for all sources of the producer.
  };

  const Parts& Standing() const;

  std::map<RecordKey, proto::MapQuarantine> quarantines_;
  std::multiset<RecordKey> lifted_;
  OriginQuota<std::optional<RecordKey>> quota_{kRecordsMax};  // The note is the key that the record lifts, if any.
  mutable std::optional<Parts> standing_;                     // Derived from the members above when needed.
};

}  // namespace moondb
