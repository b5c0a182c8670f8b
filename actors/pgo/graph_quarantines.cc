#include "actors/pgo/graph_quarantines.h"

namespace moondb {

void GraphQuarantines::Add(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  std::optional<RecordKey> lifts;
  if (quarantine.has_lifts()) {
    lifts = FromProto(quarantine.lifts());
    lifted_.insert(*lifts);
  } else if (quarantine.graph_part_case() == proto::MapQuarantine::GRAPH_PART_NOT_SET ||
             !quarantines_.emplace(key, quarantine).second) {
    return;
  }
  standing_.reset();
  for (const auto& removed : quota_.Add(key, 1, lifts)) {
    if (removed.note) {
      lifted_.erase(lifted_.find(*removed.note));
    } else {
      quarantines_.erase(removed.key);
    }
  }
}

bool GraphQuarantines::HasFactor(const RecordKey& record, const FactorKey& factor) const {
  const Parts& standing = Standing();
  const AgentId producer = record.stream.origin;
  if (standing.factors.contains(factor)) return true;
  if (factor.kind == FactorKind::kRange) return false;
  return standing.sources.contains({producer, factor.source}) || standing.sources.contains({producer, ""});
}

const GraphQuarantines::Parts& GraphQuarantines::Standing() const {
  if (standing_) return *standing_;
  Parts& parts = standing_.emplace();
  for (const auto& [key, quarantine] : quarantines_) {
    if (lifted_.contains(key)) continue;
    ++parts.count;
    if (quarantine.has_node()) parts.nodes.insert(FromProto(quarantine.node()));
    if (quarantine.has_factor()) parts.factors.insert(KeyOf(quarantine.factor()));
    if (quarantine.has_producer()) parts.sources.insert({quarantine.agent_id(), quarantine.producer().source()});
  }
  return parts;
}

}  // namespace moondb
