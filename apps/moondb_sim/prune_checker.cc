#include "apps/moondb_sim/prune_checker.h"

#include "apps/moondb_sim/state_checker.h"

namespace moondb::simulation {

HaveSet PrunedOf(const HaveSet& have) {
  HaveSet pruned;
  for (const auto& [key, stream] : have.streams()) {
    if (!MayBeSuperseded(key.type) && !stream.dropped.is_empty()) pruned[key].dropped = stream.dropped;
  }
  return pruned;
}

void PruneChecker::OnPruneRequest() {
  std::optional<HaveSet> common;
  for (const AgentId agent : {roles_.leader(), roles_.survivor()}) {
    if (agent == self_) continue;
    HaveSet has;
    for (const auto& [key, stream] : reported_[agent].streams()) {
      IntervalSet seqs = stream.Covered();
      if (common) seqs = seqs.Intersection(common->Get(key).held);
      has[key].held = seqs;
    }
    common = std::move(has);
  }
  if (common) allowed_.Merge(*common);
}

std::optional<std::string> PruneChecker::OnHave(const HaveSet& have) const {
  const HaveSet pruned = PrunedOf(have);
  for (const auto& [key, stream] : pruned.streams()) {
    const IntervalSet wrong = stream.dropped.Minus(allowed_.Get(key).held);
    if (wrong.is_empty()) continue;
    return "pruned " + ToString(RecordKey{key, wrong.intervals().front().first}) + " and " +
           std::to_string(wrong.Count() - 1) + " more of that stream, which leader and survivor had not said they had";
  }
  return std::nullopt;
}

}  // namespace moondb::simulation
