#include "actors/pgo/graph_quarantines.h"

namespace moondb {

void GraphQuarantines::Add(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  if (quarantines_.Add(key, quarantine)) standing_.reset();
}

bool GraphQuarantines::HasFactor(const RecordKey& record, const FactorKey& factor) const {
  const Parts& standing = Standing();
  const AgentId producer = record.stream.origin;
  if (standing.factors.contains(factor)) return true;
  if (factor.kind == FactorKind::kRange) return standing.sources.contains({producer, ""});
  return standing.sources.contains({producer, factor.source}) || standing.sources.contains({producer, ""});
}

bool GraphQuarantines::HasMap(const NodeKey& node, std::int64_t timestamp_ns) const {
  return HasNode(node) || Standing().maps.Contains(node.agent, timestamp_ns);
}

const GraphQuarantines::Parts& GraphQuarantines::Standing() const {
  if (standing_) return *standing_;
  Parts& parts = standing_.emplace();
  parts.maps = QuarantinedMaps(quarantines_);
  parts.nodes = quarantines_.FindNodes();
  quarantines_.ForEach([&parts](const RecordKey&, const proto::MapQuarantine& quarantine) {
    if (quarantine.graph_part_case() != proto::MapQuarantine::GRAPH_PART_NOT_SET) ++parts.count;
    if (quarantine.has_factor()) parts.factors.insert(KeyOf(quarantine.factor()));
    if (quarantine.has_producer()) parts.sources.insert({quarantine.agent_id(), quarantine.producer().source()});
  });
  return parts;
}

}  // namespace moondb
