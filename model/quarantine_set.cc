#include "model/quarantine_set.h"

namespace moondb {

bool QuarantineSet::Add(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  std::optional<RecordKey> lifts;
  if (quarantine.has_lifts()) {
    lifts = FromProto(quarantine.lifts());
    lifted_.insert(*lifts);
  } else if (!quarantines_.emplace(key, quarantine).second) {
    return false;
  }
  for (const auto& removed : quota_.Add(key, 1, lifts)) {
    if (removed.note) {
      lifted_.erase(lifted_.find(*removed.note));
    } else {
      quarantines_.erase(removed.key);
    }
  }
  return true;
}

std::set<NodeKey> QuarantineSet::FindNodes() const {
  std::set<NodeKey> nodes;
  ForEach([&nodes](const RecordKey&, const proto::MapQuarantine& quarantine) {
    if (quarantine.has_node()) nodes.insert(FromProto(quarantine.node()));
  });
  return nodes;
}

}  // namespace moondb
