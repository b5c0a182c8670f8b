#include "apps/moonctl/holdings.h"

namespace moondb {
namespace {

Series SeriesOf(const StreamKey& stream) { return {stream.origin, stream.type}; }

}  // namespace

std::map<Series, std::vector<Holding>> HoldingsOf(const std::vector<HaveSet>& haves) {
  // The union of all have-sets. A record that any agent dropped counts as dropped, because no agent needs it any more.
  HaveSet known;
  for (const HaveSet& have : haves) known.Merge(have);
  std::map<Series, std::vector<Holding>> holdings;
  for (const auto& [stream, of_anybody] : known.streams()) {
    for (std::size_t i = 0; i < haves.size(); ++i) {
      const StreamHave& own = haves[i].Get(stream);
      const std::uint64_t held = own.held.Count();
      const std::uint64_t lacking = of_anybody.held.Minus(own.Covered()).Count();
      if (held == 0 && lacking == 0) continue;
      std::vector<Holding>& row = holdings[SeriesOf(stream)];
      row.resize(haves.size());
      row[i].held += held;
      row[i].lacking += lacking;
    }
  }
  return holdings;
}

std::map<Series, HoldingPair> CompareHoldings(const HaveSet& first, const HaveSet& second) {
  std::map<Series, HoldingPair> pairs;
  for (const auto& [series, row] : HoldingsOf({first, second})) {
    pairs[series].first = row[0];
    pairs[series].second = row[1];
  }
  const HaveSet both = HeldByBoth(first, second);
  for (const auto& [stream, have] : both.streams()) pairs[SeriesOf(stream)].both[stream] = have;
  return pairs;
}

HaveSet HeldByBoth(const HaveSet& first, const HaveSet& second) {
  HaveSet both;
  for (const auto& [stream, have] : first.streams()) {
    const IntervalSet held = have.held.Intersection(second.Get(stream).held);
    if (!held.is_empty()) both[stream].held = held;
  }
  return both;
}

}  // namespace moondb
