// QuarantineSet: the records that quarantine something, and which of them another record lifts.
//
// The result depends only on the set of added records, not on their order: a record may lift a quarantine that arrives
// later. Beyond the limit, the agents with the most records keep only their newest (model/origin_quota.h).
// Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>

#include "model/origin_quota.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

class QuarantineSet {
 public:
  // `records_max`: maximum number of quarantines and of records that lift one, together.
  explicit QuarantineSet(std::uint64_t records_max) : quota_(records_max) {}

  // Adds a quarantine, or a record that lifts one. Returns false if the quarantine was added before.
  bool Add(const RecordKey& key, const proto::MapQuarantine& quarantine);

  // Calls `take(key, quarantine)` for each quarantine that no record lifts, sorted by record key.
  template <typename Take>
  void ForEach(const Take& take) const {
    for (const auto& [key, quarantine] : quarantines_) {
      if (!lifted_.contains(key)) take(key, quarantine);
    }
  }

  std::set<NodeKey> FindNodes() const;  // Returns the nodes that standing quarantines name.

  // Adds the number of records dropped because of the limit, by origin.
  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const { quota_.CountLeftOut(counts); }

 private:
  std::map<RecordKey, proto::MapQuarantine> quarantines_;
  std::multiset<RecordKey> lifted_;
  OriginQuota<std::optional<RecordKey>> quota_;  // The note is the key that the record lifts, if any.
};

}  // namespace moondb
