// Who holds what, from the have-sets that agents reported. Pure functions.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "model/have_set.h"

namespace moondb {

// An origin and a data type: the streams of all epochs together.
using Series = std::pair<AgentId, DataType>;

struct Holding {
  std::uint64_t held = 0;
  std::uint64_t lacking = 0;  // Held by another of the agents and never had by this one; superseded ones do not count.
};

// Of each series that anybody holds, what each agent holds, in the order of `haves`.
std::map<Series, std::vector<Holding>> HoldingsOf(const std::vector<HaveSet>& haves);

// Two agents' holdings of one series.
struct HoldingPair {
  Holding first;
  Holding second;
  HaveSet both;  // Held by both.
};
std::map<Series, HoldingPair> CompareHoldings(const HaveSet& first, const HaveSet& second);

// What both hold, stream by stream; nothing is dropped in it.
HaveSet HeldByBoth(const HaveSet& first, const HaveSet& second);

}  // namespace moondb
