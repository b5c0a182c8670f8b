#include "actors/pgo/graph_quarantines.h"

namespace moondb {

void GraphQuarantines::Add(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  const bool is_of_maps = quarantine.graph_part_case() == proto::MapQuarantine::GRAPH_PART_NOT_SET;
  if (is_of_maps && !quarantine.has_lifts()) return;
  if (quarantines_.Add(key, quarantine)) standing_.reset();
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
  quarantines_.ForEach([&parts](const RecordKey&, const proto::MapQuarantine& quarantine) {
    ++parts.count;
    if (quarantine.has_node()) parts.nodes.insert(FromProto(quarantine.node()));
    if (quarantine.has_factor()) parts.factors.insert(KeyOf(quarantine.factor()));
    if (quarantine.has_producer()) parts.sources.insert({quarantine.agent_id(), quarantine.producer().source()});
  });
  return parts;
}

}  // namespace moondb
