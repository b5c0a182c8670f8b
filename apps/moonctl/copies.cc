#include "apps/moonctl/copies.h"

namespace moondb {
namespace {

// Returns the records of `stream` that agent `self` holds and that are not superseded.
IntervalSet FindCounted(const std::vector<HaveSet>& haves, std::size_t self, const StreamKey& stream, bool is_latest) {
  IntervalSet held = haves[self].Get(stream).held;
  for (std::size_t i = 0; is_latest && i < haves.size(); ++i) held = held.Minus(haves[i].Get(stream).dropped);
  return held;
}

}  // namespace

std::vector<CopyCounts> CountCopies(const std::vector<HaveSet>& haves, const std::set<DataType>& latest_types) {
  std::vector<CopyCounts> counts(haves.size());
  for (std::size_t self = 0; self < haves.size(); ++self) {
    for (const auto& [stream, have] : haves[self].streams()) {
      const IntervalSet held = FindCounted(haves, self, stream, latest_types.contains(stream.type));
      IntervalSet one_other;   // Held by at least one other agent.
      IntervalSet two_others;  // Held by at least two other agents.
      for (std::size_t i = 0; i < haves.size(); ++i) {
        if (i == self) continue;
        const IntervalSet& other = haves[i].Get(stream).held;
        two_others.Add(one_other.Intersection(other));
        one_other.Add(other);
      }
      IntervalSet alone = held.Minus(one_other);
      const std::uint64_t three_or_more = held.Intersection(two_others).Count();
      counts[self].one += alone.Count();
      counts[self].three_or_more += three_or_more;
      counts[self].two += held.Count() - alone.Count() - three_or_more;
      if (!alone.is_empty()) counts[self].alone[stream].held = std::move(alone);
    }
  }
  return counts;
}

}  // namespace moondb
