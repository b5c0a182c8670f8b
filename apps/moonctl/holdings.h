// Compares the records that agents hold, using the have-sets that the agents reported. Thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "model/have_set.h"

namespace moondb {

// Identifies the records of one origin and data type, over all epochs.
using Series = std::pair<AgentId, DataType>;

struct Holding {
  std::uint64_t held = 0;
  // Number of records that another agent holds and this agent's have-set does not cover. Excludes superseded records.
  std::uint64_t lacking = 0;
};

// Returns each agent's holdings of each series. Within a series, the agents are in the order of `haves`. Omits series
// that no agent holds.
std::map<Series, std::vector<Holding>> HoldingsOf(const std::vector<HaveSet>& haves);

// Two agents' holdings of one series.
struct HoldingPair {
  Holding first;
  Holding second;
  HaveSet both;  // The records that both agents hold.
};
std::map<Series, HoldingPair> CompareHoldings(const HaveSet& first, const HaveSet& second);

// Returns the records that both agents hold, by stream. The result has no dropped records.
HaveSet HeldByBoth(const HaveSet& first, const HaveSet& second);

}  // namespace moondb
