// Counts how many agents hold each record, from the agents' have-sets. Thread-safe.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "model/have_set.h"

namespace moondb {

// Number of the records of one agent that it holds alone, with one other agent, and with two or more others.
struct CopyCounts {
  std::uint64_t one = 0;
  std::uint64_t two = 0;
  std::uint64_t three_or_more = 0;
  HaveSet alone;  // The records that the agent holds alone; nothing is dropped.
};

// Returns the counts of each agent, in the order of `haves`. A record under the policy `latest` that any agent dropped
// is superseded and does not count. `latest_types`: the types under this policy.
std::vector<CopyCounts> CountCopies(const std::vector<HaveSet>& haves, const std::set<DataType>& latest_types);

}  // namespace moondb
